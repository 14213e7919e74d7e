"""Verdicts over several lengths, and statistics that hold as often as they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.measurement.comparison import KnownLength, MeasuredSegment, PermissibleError
from sheetoflight.measurement.length import lengths
from sheetoflight.measurement.verification import (
    known_covariance,
    length_covariance,
    verify_lengths,
)
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from tests.known_lengths import PIXEL_STD, RIG, calibrated, drawn_calibration, true_ends

ENDS = np.array([[900.0, 200.0], [1000.0, 800.0]])
LENGTHS_MM = [100.0, 150.0, 200.0, 250.0, 300.0, 350.0, 400.0, 450.0]
NAMES = tuple(f"s{number}" for number in range(len(LENGTHS_MM)))
KNOWN = {name: KnownLength(length) for name, length in zip(NAMES, LENGTHS_MM, strict=True)}


def segments(
    calibration: Calibration, ends: np.ndarray, laser: str | None = None
) -> list[MeasuredSegment]:
    names = NAMES[: len(ends)]
    found = lengths(calibration, ends, names=names, laser=laser)
    return [MeasuredSegment(*one, laser) for one in zip(names, ends, found, strict=True)]


def test_the_covariance_has_the_lengths_variances_on_its_diagonal() -> None:
    measured = segments(calibrated(), true_ends(LENGTHS_MM))
    covariance = length_covariance(calibrated(), measured)
    assert np.diag(covariance) == pytest.approx([one.length.std**2 for one in measured])
    assert np.linalg.eigvalsh(covariance).min() > 0


def test_lengths_share_what_the_calibration_gets_wrong() -> None:
    """4000 draws of the calibration, image points exact, ends all over the sheet: a sample
    correlation scatters by at most 1/√4000 = 0.016; one of 28 beyond 0.08 has odds of 1e-5."""
    ends = true_ends(LENGTHS_MM)
    exact = replace(calibrated(), pixel_std=0.0)
    stated = length_covariance(exact, segments(exact, ends))
    rng = np.random.default_rng(12)
    draws = np.array(
        [
            np.linalg.norm(np.diff(drawn_calibration(rng).triangulate(ends), axis=1)[:, 0], axis=1)
            for _ in range(4000)
        ]
    )
    std = np.sqrt(np.diag(stated))
    assert draws.std(axis=0) == pytest.approx(std, rel=0.07)
    assert np.abs(np.corrcoef(draws.T) - stated / np.outer(std, std)).max() < 0.08


def test_each_laser_has_its_own_parameters() -> None:
    """The distance of one sheet tells nothing of a length on the other."""
    other = LightPlane(RIG.light_plane.normal, RIG.light_plane.distance_mm + 20.0, "right")
    covariance = Covariance(("laser.d", "right.d"), np.diag([0.16, 0.04]))
    calibration = replace(
        calibrated(covariance=covariance),
        light_planes=(RIG.light_plane, other),
        pixel_std=0.0,
    )
    (left,) = segments(calibration, ENDS[None], "laser")
    (right,) = segments(calibration, ENDS[None], "right")
    found = length_covariance(calibration, [left, right])
    assert found == pytest.approx(np.diag([left.length.std**2, right.length.std**2]))
    with pytest.raises(InputError, match="no laser 'up'"):
        length_covariance(calibration, [replace(left, laser="up")])


def test_equal_known_lengths_are_one_artefact() -> None:
    bar, block = KnownLength(300.0, 0.02), KnownLength(150.0, 0.01)
    assert known_covariance([bar, block, bar]) == pytest.approx(
        np.array([[4e-4, 0, 4e-4], [0, 1e-4, 0], [4e-4, 0, 4e-4]])
    )


def test_stated_uncertainties_hold_as_often_as_they_say() -> None:
    """1500 calibrations drawn from their covariance measure eight known lengths. The p-values of
    χ² are uniform (Kolmogorov's distance exceeds 0.07 with odds of 1e-6), and |E_n| exceeds 1 in
    5 % (the mean of eight scatters by less than 0.0057; five of these, odds below 1e-6)."""
    rng = np.random.default_rng(20110901)
    ends = true_ends(LENGTHS_MM)
    p_values, exceeded = [], []
    for _ in range(1500):
        calibration = drawn_calibration(rng)
        seen = ends + rng.normal(scale=PIXEL_STD, size=ends.shape)
        found = verify_lengths(calibration, segments(calibration, seen), KNOWN)
        p_values.append(found.statistics.chi2_p)
        exceeded.append([not one.passed for one in found.comparisons])
    assert scipy.stats.kstest(p_values, "uniform").statistic < 0.07
    assert np.mean(exceeded) == pytest.approx(0.05, abs=0.029)


def test_a_scale_error_of_one_per_cent_is_found_and_named() -> None:
    """A sheet taken for 1 % farther away makes everything 1 % longer."""
    plane = RIG.light_plane
    wrong = calibrated(plane=LightPlane(plane.normal, 1.01 * plane.distance_mm))
    found = verify_lengths(wrong, segments(wrong, true_ends(LENGTHS_MM)), KNOWN)
    assert found.statistics.scale.value == pytest.approx(10.0)
    assert "scale error" in found.statistics.findings[0]
    assert not found.passed
    assert found.worst.segment.name in {one.segment.name for one in found.failed}


def test_a_limit_decides_where_one_is_given() -> None:
    calibration = calibrated()
    measured = segments(calibration, true_ends(LENGTHS_MM))
    known = KNOWN | {"s3": KnownLength(250.4), "s7": KnownLength(449.0)}
    assert not verify_lengths(calibration, measured, known, PermissibleError(0.5)).passed
    found = verify_lengths(calibration, measured, known, PermissibleError(0.3, per_m=2.0))
    assert found.passed
    assert found.worst.segment.name == "s7"
    assert found.worst.limit == pytest.approx(0.3 + 0.898)


def test_segments_of_unknown_length_are_listed_and_not_judged() -> None:
    calibration = calibrated()
    measured = segments(calibration, true_ends(LENGTHS_MM))
    found = verify_lengths(calibration, measured, {"s2": KNOWN["s2"]})
    assert [one.segment.name for one in found.comparisons] == ["s2"]
    assert len(found.not_judged) == 7
    with pytest.raises(InputError, match="none of the 8 segments has a known length"):
        verify_lengths(calibration, measured, {})


def test_there_must_be_something_to_judge_by() -> None:
    blind = replace(calibrated(covariance=Covariance((), np.zeros((0, 0)))), pixel_std=0.0)
    measured = segments(blind, true_ends(LENGTHS_MM))
    with pytest.raises(UntrustworthyError, match="segment 's0' has an uncertainty"):
        verify_lengths(blind, measured, KNOWN)
    assert verify_lengths(blind, measured, KNOWN, PermissibleError(0.1)).passed
