"""Wrong matches found: first pair by pair, then by what a camera makes of them.

Any two pictures of a camera that only turns differ by a homography, of one that is carried about
by a fundamental matrix: samples that most matches agree with (`estimation.ransac`) leave out the
gross errors, whose pairs contradict each other. Then the camera is estimated, every match is judged
by its own residual, those left out before among them, and the camera is estimated again, until
the verdict stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.absolute_conic import epipolar_distances, fundamental_matrix
from sheetoflight.calibration.board_closed_form import homographies
from sheetoflight.calibration.placed_tracks import PlacedTracks, placed_tracks
from sheetoflight.calibration.self_calibration import STAGE, SelfCalibration, pairs_of
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.ransac import consensus
from sheetoflight.geometry.directions import Array

_SEED = 1
_DRAWS = 80
"""With three of ten pairs wrong, eight right ones are missed in all draws once in 100."""

_PARTNERS = 5
_SAMPLE = {True: 4, False: 8}
_FEWEST = {True: 7, False: 14}
"""Matches of a pair of views that say which of them are wrong, with turns alone and without."""

_GROSS = 0.02
"""Part of the picture's half diagonal beyond which no lens takes a right match."""

_STRAY = 8.0
"""Robust standard deviations; the lens's distortion, not yet known, is among what scatters."""

_STRAY_PX = 1.0
_MOST_WRONG = 0.4
_FALSE_ALARM = 0.01
"""Odds that a right match of the whole set is left out."""

_ROUNDS = 8
_NO_NOISE_PX = 1e-5

Estimate = Callable[[Array], SelfCalibration]
"""The camera from tracks ``(V, T, 2)`` px, NaN where not seen."""


@dataclass(frozen=True, eq=False)
class ScreenedMatches:
    """A camera from matches, and which of them it does not rest on.

    Parameters
    ----------
    fit : SelfCalibration
    residuals : (V, T, 2) array
        Observed minus predicted, px; NaN where not seen, or left out.
    wrong : (V, T) mask
        Matches left out because they contradict the others.
    unused : (V, T) mask
        Matches that nothing checks: the only one left of their point, or in front of no camera.
    """

    fit: SelfCalibration
    residuals: Array
    wrong: np.ndarray
    unused: np.ndarray


def screened_matches(
    uv: Array,
    image_size: tuple[int, int],
    turns_only: bool,
    estimate: Estimate,
    weights: Array | None = None,
) -> ScreenedMatches:
    """Estimate a camera without the matches that are wrong.

    Parameters
    ----------
    uv : (V, T, 2) array
        Image points of T tracks in V views, px; NaN where not seen.
    image_size : (int, int)
        Width and height, px.
    turns_only : bool
        Whether the camera stays in its place.
    estimate : callable
    weights : (V, T) array, optional
        Of the image points' residuals; 1 where absent.

    Raises
    ------
    UntrustworthyError
        If most matches contradict each other, or as `estimate`.
    """
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    weights = np.ones(uv.shape[:2]) if weights is None else weights
    wrong = contradicting(uv, image_size, turns_only)
    _refuse_most_wrong(wrong, seen, turns_only)
    for _ in range(_ROUNDS):
        kept = np.where(wrong[..., None], np.nan, uv)
        fit = estimate(kept)
        noise = _noise(placed_tracks(kept, weights, fit))
        again = misfitting(uv, weights, fit, noise, wrong)
        if (again == wrong).all():
            break
        wrong = again
        _refuse_most_wrong(wrong, seen, turns_only)
    else:
        kept = np.where(wrong[..., None], np.nan, uv)
        fit = estimate(kept)
    placed = placed_tracks(kept, weights, fit)
    used = np.isfinite(placed.misfit)
    return ScreenedMatches(fit, placed.residuals, wrong, seen & ~wrong & ~used)


def contradicting(uv: Array, image_size: tuple[int, int], turns_only: bool) -> np.ndarray:
    """Matches ``(V, T)`` that are in more contradictions with others than these are.

    Of each track the image points are left out one by one, those first that contradict the most
    others, until no pair of what remains contradicts. Where two contradict each other and no
    third tells which is wrong, both are.
    """
    gross = _GROSS * 0.5 * float(np.hypot(*image_size))
    against = np.zeros((len(uv), len(uv), uv.shape[1]), dtype=bool)
    for i, j in _chosen_pairs(uv, _FEWEST[turns_only]):
        both = np.flatnonzero(np.isfinite(uv[[i, j]]).all(axis=(0, 2)))
        stray = ~_agreeing(uv[j, both], uv[i, both], turns_only, gross)
        against[i, j, both[stray]] = against[j, i, both[stray]] = True
    wrong = np.zeros(uv.shape[:2], dtype=bool)
    while against.any():
        count = against.sum(axis=1)
        worst = (count == count.max(axis=0)) & (count > 0)
        wrong |= worst
        against &= ~worst[:, None] & ~worst[None]
    return wrong


def _chosen_pairs(uv: Array, fewest: int) -> list[tuple[int, int]]:
    """Of each view, the pairs with those that it shares the most points with."""
    seen = np.isfinite(uv[..., 0]).astype(int)
    shared = seen @ seen.T
    best = np.argsort(-(shared - np.diag(np.diag(shared) + 1)), axis=1, kind="stable")
    near = {(i, int(j)) for i in range(len(uv)) for j in best[i, :_PARTNERS]}
    return [(i, j) for i, j in pairs_of(uv, fewest) if (i, j) in near or (j, i) in near]


def _agreeing(first: Array, second: Array, turns_only: bool, gross: float) -> np.ndarray:
    """Mask ``(M,)`` of the matches of two views that the map of most of them holds for."""

    def distances(sample: np.ndarray) -> Array:
        return _distances(first, second, sample, turns_only)

    size, rng = _SAMPLE[turns_only], np.random.default_rng(_SEED)
    agreeing = consensus(len(first), size, distances, gross, _DRAWS, rng).inliers
    if agreeing.sum() < _FEWEST[turns_only]:
        return np.ones(len(first), dtype=bool)  # no map to judge by: the camera will tell
    for _ in range(3):
        distance = distances(np.flatnonzero(agreeing))
        scatter = 1.4826 * float(np.median(np.abs(distance[agreeing])))
        within = np.abs(distance) <= min(max(_STRAY * scatter, _STRAY_PX), gross)
        if within.sum() < _FEWEST[turns_only] or (within == agreeing).all():
            break
        agreeing = within
    return agreeing


def _distances(first: Array, second: Array, sample: np.ndarray, turns_only: bool) -> Array:
    """Distances ``(M,)`` px of all matches from the map of some; infinite where there is none."""
    with np.errstate(all="ignore"):
        if turns_only:
            flat = np.column_stack([first[sample], np.zeros(len(sample))])
            H = homographies(flat, second[sample][None])[0]
            there = np.column_stack([first, np.ones(len(first))]) @ H.T
            distance = np.linalg.norm(there[:, :2] / there[:, 2:] - second, axis=1)
        else:
            F = fundamental_matrix(first[sample], second[sample])
            distance = np.full(len(first), np.inf)
            if F is not None:
                distance = epipolar_distances(F, first, second)
    return np.where(np.isfinite(distance), distance, np.inf)


def _noise(placed: PlacedTracks) -> float:
    """Robust standard deviation of an image coordinate of weight 1, px: misfits are chi-squared
    of their rank."""
    told = placed.rank > 0
    if not told.any():
        return _NO_NOISE_PX
    ratio = placed.misfit[told] / chdtri(placed.rank[told], 0.5)
    return max(float(np.sqrt(np.median(ratio))), _NO_NOISE_PX)


def misfitting(
    uv: Array, weights: Array, fit: SelfCalibration, noise: float, wrong: np.ndarray
) -> np.ndarray:
    """Matches ``(V, T)`` whose residuals noise alone would hardly bring about.

    Of each track the worst one is left out and the track placed again, until all that remain fit;
    both where two are as bad. Those left out that then fit are taken back.

    Parameters
    ----------
    uv : (V, T, 2) array
    weights : (V, T) array
    fit : SelfCalibration
    noise : float
        Standard deviation of an image coordinate of weight 1, px.
    wrong : (V, T) mask
        The last verdict. Tracks of which it leaves less than two points begin anew.
    """
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    odds = _FALSE_ALARM / max(int(seen.sum()), 1)
    limits = noise**2 * np.array([np.inf, chdtri(1, odds), chdtri(2, odds)])
    anew = (seen & ~wrong).sum(axis=0) < 2
    out = wrong & ~anew
    while True:
        placed = placed_tracks(uv, weights, fit, out)
        excess = np.where(np.isnan(placed.misfit), 0.0, placed.misfit) / limits[placed.rank]
        inner = np.where(out, 0.0, excess)
        most = inner.max(axis=0, initial=0.0)
        worst = (most > 1.0) & (inner >= (1.0 - 1e-6) * most)
        if not worst.any():
            break
        out |= worst
    unplaced = anew & np.isnan(placed.misfit)
    return (out & ~(excess <= 1.0)) | (unplaced & wrong)


def _refuse_most_wrong(wrong: np.ndarray, seen: np.ndarray, turns_only: bool) -> None:
    """Refuse where too many matches contradict each other to tell the wrong from the right."""
    share = wrong.sum() / max(int(seen.sum()), 1)
    if share <= _MOST_WRONG:
        return
    moved = (
        "; a camera that was carried about does the same where the scene has depth"
        if turns_only
        else ""
    )
    raise UntrustworthyError(
        STAGE,
        f"{share:.0%} of the matches contradict the others{moved}",
        "match again with stricter settings" + (", or use moving-camera" if turns_only else ""),
    )
