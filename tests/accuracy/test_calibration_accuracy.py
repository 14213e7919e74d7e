"""The figures that the calibration must reach, from points with noise.

Seeds are fixed. The odds that a right program fails by chance stand with each statement; the
short forms run with all tests, the long ones as ``make accuracy``.
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.seed_rig import CASES, Case, length_errors
from bench.solver import (
    differences,
    joint,
    scipy_solution,
    seconds_per_view,
    simulated_rig,
    speed_ratio,
    starting_state,
)
from bench.zhang import zhang_trials

ZHANG_LIMIT_PERCENT = 0.45


def test_zhang_short() -> None:
    """20 trials: every mean absolute error below its expectation by four standard errors.

    |N(0, s)| has mean 0.80 s and standard deviation 0.60 s; five parameters: odds below 2e-4.
    """
    result = zhang_trials(20)
    expected = np.sqrt(2 / np.pi) * result.bound_percent
    scatter = np.sqrt(1 - 2 / np.pi) * result.bound_percent / np.sqrt(20)
    assert (result.percent < expected + 4 * scatter).all()
    assert result.chi2_per_dof.max() < 1.5


@pytest.mark.accuracy
def test_zhang_in_full() -> None:
    """The issue's figure, with the same 120 trials that ``python -m bench.zhang`` prints."""
    result = zhang_trials()
    assert (result.percent <= ZHANG_LIMIT_PERCENT).all(), result.percent
    assert result.chi2_per_dof.max() <= 1.5
    # and no better than physics allows: the normalised errors have unit variance;
    # 600 of them: their variance scatters by 6 %, four of which are exceeded with odds 6e-5
    normalised = result.errors / result.std
    assert np.mean(normalised**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 600))


def joint_limit(case: Case, column: int) -> float:
    """The promised joint figure and 20 %."""
    return 1.2 * case.promised["joint"][column]


def test_seed_rig_short() -> None:
    """Ten calibrations of the first case by joint and two-step.

    The joint mean over 150 calibrations is 0.070 mm at 450 mm and a calibration's own mean
    scatters by 0.045 mm; ten stay below 0.13 mm with odds above 1 - 1e-4.
    """
    joint_errors = np.abs(length_errors(CASES[0], "joint", 10)).mean(axis=(0, 2))
    two_step = np.abs(length_errors(CASES[0], "two-step", 10)).mean(axis=(0, 2))
    assert joint_errors[1] < 0.13
    assert joint_errors[1] < two_step[1]


@pytest.mark.accuracy
@pytest.mark.parametrize("case", [CASES[0], CASES[2], CASES[3]], ids=lambda case: case.name)
def test_seed_rig_joint_in_full(case: Case) -> None:
    """The promised joint column within 20 %, at 450 mm.

    The case of 0.3 px is left to `test_errors_are_proportional_to_the_noise`: its promise, 2.2
    times that of 0.1 px, lies below the Cramér–Rao bound, which is 3 times it.
    """
    errors = np.abs(length_errors(case, "joint", 300)).mean(axis=(0, 2))
    assert errors[1] <= joint_limit(case, 1)


@pytest.mark.accuracy
def test_errors_are_proportional_to_the_noise() -> None:
    """A maximum-likelihood estimate of a nearly linear problem: three times the noise, three
    times the error. The same seeds, so that only curvature makes a difference."""
    low = np.abs(length_errors(CASES[0], "joint", 100)).mean(axis=(0, 2))
    high = np.abs(length_errors(CASES[1], "joint", 100)).mean(axis=(0, 2))
    assert high / low == pytest.approx(3.0, rel=0.05)


@pytest.mark.accuracy
@pytest.mark.parametrize("case", CASES[:3], ids=lambda case: case.name)
def test_the_papers_pipeline_is_no_worse_than_its_own_column(case: Case) -> None:
    """At 450 mm. A calibration's own mean error scatters widely with its poses: the mean of 100
    lies above the promised figure by three of its standard errors with odds of 1 in 700."""
    own_means = np.abs(length_errors(case, "paper", 100))[:, 1].mean(axis=1)
    standard_error = own_means.std() / np.sqrt(len(own_means))
    assert own_means.mean() <= case.promised["paper"][1] + 3 * standard_error


def test_the_joint_optimum_is_scipys() -> None:
    rig = simulated_rig(30, 10)
    start = starting_state(rig)
    reference = scipy_solution(rig, start, "3-point").x
    assert differences(joint(rig, start), reference).max() < 1e-6


def test_the_joint_adjustment_is_20_times_faster_than_scipy() -> None:
    rig = simulated_rig(30, 10)
    assert speed_ratio(rig, starting_state(rig), rounds=3) >= 20


@pytest.mark.accuracy
def test_the_cost_is_linear_in_the_number_of_views() -> None:
    """From 1000 to 10 000 views the time a view may not grow; twice, for a noisy machine."""
    times = seconds_per_view((1000, 10_000))
    assert times[10_000] < 2 * times[1000]
