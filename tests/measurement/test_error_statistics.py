"""Bias, scale and chi-square of errors, against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from sheetoflight.measurement.error_statistics import Estimate, error_statistics

LENGTHS = np.array([100.0, 150.0, 200.0, 300.0, 450.0, 450.0])


def summed_up(errors, lengths=LENGTHS, std=0.1):
    errors = np.asarray(errors, dtype=float)
    return error_statistics(errors, lengths, std**2 * np.eye(len(errors)))


def test_plain_numbers_by_hand() -> None:
    found = summed_up([0.1, -0.2, 0.4], np.full(3, 300.0))
    assert found.number == 3
    assert found.mean.value == pytest.approx(0.1)
    assert found.spread == pytest.approx(0.3)
    assert found.rms == pytest.approx(np.sqrt(0.07))
    assert found.largest == pytest.approx(0.4)


def test_independent_errors_average_out_and_shared_ones_do_not() -> None:
    errors, ones = np.zeros(6), np.ones((6, 6))
    alone = error_statistics(errors, LENGTHS, 0.04 * np.eye(6))
    shared = error_statistics(errors, LENGTHS, 0.04 * ones)
    assert alone.mean.std == pytest.approx(0.2 / np.sqrt(6))
    assert shared.mean.std == pytest.approx(0.2)


def test_a_scale_that_all_lengths_share_is_the_scales_uncertainty() -> None:
    """Lengths that share a relative error of 1e-4, and nothing else: 0.1 mm/m."""
    found = error_statistics(np.zeros(6), LENGTHS, 1e-8 * np.outer(LENGTHS, LENGTHS))
    assert found.scale.std == pytest.approx(0.1)
    assert found.offset is not None
    assert found.offset.std == pytest.approx(0.0, abs=1e-6)


def test_scale_and_constant_error_are_a_straight_line() -> None:
    """Against NumPy's straight line and the closed form of its slope's uncertainty."""
    errors = np.random.default_rng(3).normal(scale=0.1, size=6)
    found = summed_up(errors)
    slope, intercept = np.polyfit(LENGTHS / 1000, errors, 1)
    spread = np.sum((LENGTHS / 1000 - np.mean(LENGTHS / 1000)) ** 2)
    assert found.scale.value == pytest.approx(slope)
    assert found.scale.std == pytest.approx(0.1 / np.sqrt(spread))
    assert found.offset is not None
    assert found.offset.value == pytest.approx(intercept)


def test_a_scale_error_of_one_per_cent_is_found_and_named() -> None:
    found = summed_up(0.01 * LENGTHS)
    assert found.scale.value == pytest.approx(10.0)
    assert any("+10 mm/m" in text and "scale error" in text for text in found.findings)
    assert not any("constant error" in text for text in found.findings)


def test_a_constant_error_is_found_and_named() -> None:
    found = summed_up(np.full(6, -0.5))
    assert found.scale.value == pytest.approx(0.0, abs=1e-9)
    assert any("constant error of -0.5 mm" in text for text in found.findings)
    assert not any("scale error" in text for text in found.findings)


def test_one_length_cannot_tell_scale_from_a_constant_error() -> None:
    found = summed_up(np.full(4, 3.0), np.full(4, 300.0))
    assert found.offset is None
    assert found.scale.value == pytest.approx(10.0)
    assert any("too alike" in text and "+10 mm/m" in text for text in found.findings)


def test_errors_of_the_stated_size_give_no_finding() -> None:
    assert summed_up([0.1, -0.1, 0.05, -0.12, 0.1, -0.02]).findings == ()


def test_errors_of_another_size_are_told() -> None:
    errors = np.array([0.1, -0.1, 0.05, -0.12, 0.1, -0.02])
    (larger,) = summed_up(errors, std=0.02).findings
    (smaller,) = summed_up(errors, std=2.0).findings
    assert "larger than the stated uncertainties" in larger
    assert "smaller than the stated uncertainties" in smaller


def test_chi_square_of_independent_errors() -> None:
    errors = np.random.default_rng(5).normal(scale=0.1, size=6)
    found = summed_up(errors)
    assert found.chi2 == pytest.approx(np.sum((errors / 0.1) ** 2))
    assert found.chi2_p == pytest.approx(scipy.stats.chi2.sf(found.chi2, 6))


def test_chi_square_is_the_same_in_all_coordinates() -> None:
    rng = np.random.default_rng(6)
    errors, mixing = rng.normal(size=6), rng.normal(size=(6, 6))
    whole = error_statistics(mixing @ errors, LENGTHS, mixing @ mixing.T)
    assert whole.chi2 == pytest.approx(errors @ errors)


@pytest.mark.parametrize(
    "covariance", [np.ones((6, 6)), np.zeros((6, 6))], ids=["one direction", "none"]
)
def test_a_covariance_that_excludes_errors_has_no_chi_square(covariance: np.ndarray) -> None:
    found = error_statistics(np.linspace(-1, 1, 6), LENGTHS, covariance)
    assert found.chi2 is None
    assert found.chi2_p is None


def test_the_error_that_disagrees_is_known_though_all_share_a_larger_one() -> None:
    """Shared by all 1 mm, each its own 0.02 mm: 0.3 mm beside the others is no small thing."""
    covariance = np.ones((6, 6)) + 4e-4 * np.eye(6)
    errors = np.array([0.71, 0.69, 0.7, 1.0, 0.7, 0.69])
    found = error_statistics(errors, LENGTHS, covariance)
    assert found.odd_one == 3
    own = 0.02 * np.sqrt(1 + 1 / 5)
    expected = errors[3] - np.delete(errors, 3).mean()
    assert found.disagreement[3] == pytest.approx(expected / own, rel=1e-3)
    assert error_statistics(np.full(6, 0.7), LENGTHS, covariance).odd_one is None


def test_a_single_error_has_no_spread() -> None:
    found = summed_up([0.1], np.array([300.0]))
    assert found.spread is None
    assert found.offset is None
    assert found.mean.std == pytest.approx(0.1)


def test_odds_of_an_estimate() -> None:
    assert Estimate(-1.959964, 1.0).p_value == pytest.approx(0.05, rel=1e-6)
    assert Estimate(1.0, 0.0).p_value is None
    assert not Estimate(1.0, 0.0).significant
