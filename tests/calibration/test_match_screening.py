"""Wrong matches are found, right ones kept, and the camera is as if they had never been."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from sheetoflight.calibration.match_screening import (
    ScreenedMatches,
    contradicting,
    screened_matches,
)
from sheetoflight.calibration.moving_camera import moving_camera
from sheetoflight.calibration.placed_tracks import placed_tracks
from sheetoflight.calibration.rotating_camera import rotating_camera
from sheetoflight.calibration.self_calibration import SelfCalibration
from sheetoflight.errors import UntrustworthyError
from tests.calibration.tracks import BARREL, TWO_AXES, carried, moving, scene, turning

SIZE = BARREL.image_size
NOISE = 0.3
FREE = [0, 1, 3, 4, 5]


def estimate(turns_only: bool, uv: np.ndarray) -> SelfCalibration:
    method = rotating_camera if turns_only else moving_camera
    return method(uv, SIZE, "radial1", "rectangular", NOISE)


def screen(turns_only: bool, uv: np.ndarray) -> ScreenedMatches:
    return screened_matches(uv, SIZE, turns_only, lambda kept: estimate(turns_only, kept))


def recorded(turns_only: bool, seed: int) -> tuple[np.ndarray, np.random.Generator]:
    """Tracks with noise through a camera with distortion."""
    rng = np.random.default_rng(seed)
    if turns_only:
        uv = turning(BARREL, TWO_AXES, 120, rng)
    else:
        uv = moving(BARREL, *carried(6, rng), scene(90, rng))
    return uv + NOISE * rng.normal(size=uv.shape), rng


def spoiled(
    uv: np.ndarray, share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Tracks of which a share of the image points is anywhere in the picture."""
    bad = np.isfinite(uv[..., 0]) & (rng.random(uv.shape[:2]) < share)
    worse = uv.copy()
    worse[bad] = rng.uniform(0, 1, (int(bad.sum()), 2)) * SIZE
    return worse, bad


@pytest.mark.parametrize("turns_only", [True, False])
@pytest.mark.parametrize("share", [0.03, 0.15])
def test_wrong_matches_are_found_and_right_ones_kept(turns_only: bool, share: float) -> None:
    uv, rng = recorded(turns_only, 1)
    worse, bad = spoiled(uv, share, rng)
    found = screen(turns_only, worse)
    assert not (bad & ~found.wrong & ~found.unused).any()
    # a right match falls with a wrong one only where the two are all there is of their track
    pairs = bad.any(axis=0) & ((np.isfinite(uv[..., 0]) & ~bad).sum(axis=0) < 2)
    assert not (found.wrong & ~bad)[:, ~pairs].any()


@pytest.mark.parametrize("turns_only", [True, False])
def test_nothing_is_left_out_where_all_is_right(turns_only: bool) -> None:
    """By design a right match falls in one set of a hundred; three sets with none."""
    for seed in range(3):
        found = screen(turns_only, recorded(turns_only, seed)[0])
        assert not found.wrong.any()


@pytest.mark.parametrize("turns_only", [True, False])
def test_the_stated_uncertainty_holds_in_spite_of_wrong_matches(turns_only: bool) -> None:
    """Normalised errors of 5 trials, 25 numbers; they leave the interval once in 5000 by chance."""
    total, trials = 0.0, 5
    for seed in range(trials):
        uv, rng = recorded(turns_only, 20 + seed)
        fit = screen(turns_only, spoiled(uv, 0.05, rng)[0]).fit
        error = (fit.camera.parameters - BARREL.parameters)[FREE]
        total += float(error @ np.linalg.solve(fit.covariance, error))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], trials * len(FREE))
    assert low < total < high


def test_without_screening_wrong_matches_spoil_the_camera() -> None:
    uv, rng = recorded(True, 1)
    worse, _ = spoiled(uv, 0.05, rng)
    try:
        fit = estimate(True, worse)
    except UntrustworthyError:
        return
    error = (fit.camera.parameters - BARREL.parameters)[FREE]
    assert error @ np.linalg.solve(fit.covariance, error) > 1000.0


def test_small_errors_that_no_pair_shows_are_found_by_the_camera() -> None:
    """Five pixels: far less than a lens's distortion does to a homography."""
    uv, _ = recorded(True, 3)
    often = np.flatnonzero(np.isfinite(uv[..., 0]).sum(axis=0) >= 4)[:3]
    wrong = np.zeros(uv.shape[:2], dtype=bool)
    for track in often:
        wrong[np.flatnonzero(np.isfinite(uv[:, track, 0]))[0], track] = True
    uv[wrong] += [5.0, -5.0]
    assert not contradicting(uv, SIZE, True)[wrong].all()
    assert np.array_equal(screen(True, uv).wrong, wrong)


def test_two_that_contradict_each_other_both_go() -> None:
    uv, _ = recorded(True, 4)
    track = int(np.flatnonzero(np.isfinite(uv[..., 0]).sum(axis=0) == 2)[0])
    uv[np.flatnonzero(np.isfinite(uv[:, track, 0]))[1], track] += [90.0, 60.0]
    assert screen(True, uv).wrong[:, track].sum() == 2


def test_a_carried_camera_is_refused_by_the_method_for_turns() -> None:
    uv, _ = recorded(False, 5)
    with pytest.raises(UntrustworthyError, match=r"contradict the others.*use moving-camera"):
        screen(True, uv)


def test_nonsense_is_refused() -> None:
    uv = np.random.default_rng(6).uniform(0, 1, (5, 60, 2)) * SIZE
    for turns_only in (True, False):
        with pytest.raises(UntrustworthyError):
            screen(turns_only, uv)


@pytest.mark.parametrize("turns_only", [True, False])
def test_misfits_of_right_matches_are_chi_squared_of_their_rank(turns_only: bool) -> None:
    """With the true camera; sums over some 300 to 500 points leave 5 σ by chance once in 10⁶."""
    uv, _ = recorded(turns_only, 7)
    fit = estimate(turns_only, uv)
    placed = placed_tracks(uv, np.ones(uv.shape[:2]), fit)
    told = placed.rank > 0
    total, rank = placed.misfit[told].sum() / NOISE**2, int(placed.rank[told].sum())
    # the statistics of one track hang together: at most all of a track's points are alike
    assert abs(total - rank) < 5.0 * np.sqrt(2.0 * rank * len(uv))
    assert 0.5 * rank < total < 1.5 * rank


def test_a_point_left_out_is_judged_as_one_that_is_in() -> None:
    """Leaving a point out and judging it from the others is the same statistic, but for the
    curvature of the map."""
    uv, _ = recorded(False, 8)
    fit, weights = estimate(False, uv), np.ones(uv.shape[:2])
    inside = placed_tracks(uv, weights, fit).misfit
    out = np.zeros(uv.shape[:2], dtype=bool)
    out[2] = True
    outside = placed_tracks(uv, weights, fit, out).misfit
    seen = np.isfinite(uv[2, :, 0])
    assert seen.sum() > 50
    assert np.allclose(outside[2, seen], inside[2, seen], rtol=0.02, atol=1e-3)
