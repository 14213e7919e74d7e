"""Where points followed through pictures are, camera and poses being known, and how well they fit.

The statistic of an image point is Baarda's, for its two coordinates together (W. Baarda, *A testing
procedure for use in geodetic networks*, 1968): with the residual r, its derivatives J by the
track's place, that place's covariance C and the weight w, ``q = w² rᵀ (1 − w² J C Jᵀ)⁺ r`` for a
point that the place rests on, and ``q = w² rᵀ (1 + w² J C Jᵀ)⁻¹ r`` for one that it does not rest
on. Over σ² it is a chi-squared of one or two degrees of freedom, the rank of the matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.self_calibration import SelfCalibration
from sheetoflight.calibration.track_adjustment import TrackAdjustment, TrackState
from sheetoflight.calibration.track_start import triangulated
from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.geometry.directions import Array, moved, normalised

_STEPS = 6
"""Gauss-Newton's, from a linear start: the third is as good as the last where a match is right."""

_UNCHECKED = 0.02
"""Eigenvalues of 1 − w² J C Jᵀ below which a coordinate says nothing of itself."""


@dataclass(frozen=True, eq=False)
class PlacedTracks:
    """Tracks placed, each by itself.

    Parameters
    ----------
    residuals : (V, T, 2) array
        Observed minus predicted, px; NaN where not seen, or the track could not be placed.
    misfit : (V, T) array
        q, px²; NaN likewise, infinite behind the camera.
    rank : (V, T) int array
        Its degrees of freedom; 0 where nothing checks the point.
    """

    residuals: Array
    misfit: Array
    rank: np.ndarray


def placed_tracks(
    uv: Array, weights: Array, fit: SelfCalibration, left_out: np.ndarray | None = None
) -> PlacedTracks:
    """Place every track with the camera and the poses of a fit.

    Parameters
    ----------
    uv : (V, T, 2) array
        Image points, px; NaN where not seen.
    weights : (V, T) array
        Of the image points' residuals.
    fit : SelfCalibration
    left_out : (V, T) mask, optional
        Image points that are judged, but on which no place rests.
    """
    out = np.zeros(uv.shape[:2], dtype=bool) if left_out is None else left_out
    kept = np.where(out[..., None], np.nan, uv)
    places = _start(kept, fit)
    known = np.isfinite(places[:, 0])
    residuals = np.full(uv.shape, np.nan)
    misfit, rank = np.full(uv.shape[:2], np.nan), np.zeros(uv.shape[:2], dtype=int)
    if known.any():
        state, covariance = _adjusted(kept[:, known], weights[:, known], fit, places[known])
        parts = _judged(uv[:, known], weights[:, known], state, covariance, out[:, known])
        residuals[:, known], misfit[:, known], rank[:, known] = parts
    return PlacedTracks(residuals, misfit, rank)


def _start(uv: Array, fit: SelfCalibration) -> Array:
    """Places ``(T, 3)`` by linear equations; NaN where there is none."""
    rays, poses = fit.camera.unproject(uv), fit.camera_from_first
    if poses[..., 3].any():
        return triangulated(poses, rays[..., :2])
    total = np.nansum(normalised(rays) @ poses[..., :3], axis=0)
    total[np.isfinite(uv[..., 0]).sum(axis=0) < 2] = np.nan
    return normalised(total)


def _adjusted(
    uv: Array, weights: Array, fit: SelfCalibration, places: Array
) -> tuple[TrackState, Array]:
    """The least-squares places, and the inverse of their normal equations ``(T, k, k)``."""
    poses = fit.camera_from_first
    turns_only = not poses[..., 3].any()
    problem = TrackAdjustment(uv, np.zeros((10, 0)), turns_only, weights)
    state = TrackState(fit.camera, poses[..., :3], poses[..., 3], places)
    (block,) = problem.blocks(state)
    for _ in range(_STEPS):
        step = -np.einsum("tkl,til,ti->tk", _inverse_normal(block), block.by_local, block.residuals)
        after = moved(state.places, step) if turns_only else state.places + step
        (stepped,) = problem.blocks(_with_places(state, after))
        better = np.asarray(_squares(stepped) <= _squares(block))
        state = _with_places(state, np.where(better[:, None], after, state.places))
        (block,) = problem.blocks(state)
    return state, _inverse_normal(block)


def _inverse_normal(block: Block) -> Array:
    normal = np.swapaxes(block.by_local, 1, 2) @ block.by_local
    usable = np.asarray(np.isfinite(normal).all(axis=(1, 2)))
    return np.linalg.pinv(np.where(usable[:, None, None], normal, 0.0), hermitian=True)


def _squares(block: Block) -> Array:
    return np.sum(block.residuals**2, axis=1)


def _with_places(state: TrackState, places: Array) -> TrackState:
    return TrackState(state.camera, state.rotations, state.translations, places)


def _judged(
    uv: Array, weights: Array, state: TrackState, covariance: Array, out: np.ndarray
) -> tuple[Array, Array, np.ndarray]:
    """Residuals, misfits and ranks of all points, those on which no place rests among them."""
    views, count = uv.shape[:2]
    (block,) = TrackAdjustment(uv, np.zeros((10, 0)), state.turns_only).blocks(state)
    residuals = -block.residuals.reshape(count, views, 2)
    slope = weights.T[..., None, None] * block.by_local.reshape(count, views, 2, -1)
    spread = slope @ covariance[:, None] @ np.swapaxes(slope, 2, 3)
    finite = np.isfinite(spread).all(axis=(2, 3)) & np.isfinite(residuals).all(axis=2)
    usable = np.asarray(finite)
    sign = np.where(out.T, 1.0, -1.0)[..., None, None]
    size, axes = np.linalg.eigh(np.eye(2) + sign * np.where(usable[..., None, None], spread, 0.0))
    along = np.einsum("tvji,tvj->tvi", axes, np.where(usable[..., None], residuals, 0.0))
    told = size > _UNCHECKED
    parts = np.where(told, along**2 / np.where(told, size, 1.0), 0.0)
    misfit = np.where(usable, weights.T**2 * parts.sum(axis=-1), np.inf).T
    rank = np.where(usable, told.sum(axis=-1), 2).T
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    return (
        np.where(seen[..., None], np.swapaxes(residuals, 0, 1), np.nan),
        np.where(seen, misfit, np.nan),
        np.where(seen, rank, 0),
    )
