"""The other pose of a target, for descents stay in the one they began in.

Given the camera and the fixed point, the ray of a far marker meets the sphere that the marker
can reach twice, so every view of a pivoting target has two stable poses. A target that a sheet
crosses may be caught in a wrong slant; its spot in the sheet tells the right one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sheetoflight.calibration.crossing_start import poses_through_spots
from sheetoflight.calibration.placements import placed
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews


def reselected(
    state: RigState, stages: Mapping[str, TargetViews], positions: Array
) -> tuple[RigState, bool]:
    """The state with poses that fit better, and whether there are any."""
    changed = np.zeros(0, dtype=bool)
    if "camera" in stages:
        now = state.poses["camera"]
        directions, changed = reselected_directions(
            state.camera, state.anchor, now, stages["camera"], positions
        )
        state = state.with_poses("camera", directions)
    if "crossing" not in stages:
        return state, bool(changed.any())
    views, now = stages["crossing"], state.poses["crossing"]
    poses, there = poses_through_spots(state, positions, views)
    other = state.with_poses("crossing", np.where(there[:, None], poses, now))
    better = _crossing_errors(other, views, positions) < _crossing_errors(state, views, positions)
    state = state.with_poses("crossing", np.where(better[:, None], other.poses["crossing"], now))
    return state, bool(changed.any() or better.any())


def _crossing_errors(state: RigState, views: TargetViews, positions: Array) -> Array:
    """Sum of squared residuals ``(N,)``; infinite for impossible poses."""
    uv = state.camera.project(placed(state, "crossing", positions, views).points)
    errors = np.nan_to_num(np.sum((uv - views.uv) ** 2, axis=-1), nan=np.inf)
    return np.where(views.seen, errors, 0.0).sum(axis=1)


def reselected_directions(
    camera: Camera,
    anchor: Array,
    directions: Array,
    views: TargetViews,
    positions: Array,
    gross_px: float = np.inf,
) -> tuple[Array, np.ndarray]:
    """For every view the pose with the least reprojection error among all intersections.

    Parameters
    ----------
    camera : Camera
    anchor : (3,) array
        The fixed point, mm.
    directions : (N, 3) array
        Present directions; each is kept unless another one fits better.
    views : TargetViews
        N views.
    positions : (M,) array
        Marker positions from the fixed point, mm.
    gross_px : float
        Reprojection error beyond which a marker is no more wrong than at it.

    Returns
    -------
    directions : (N, 3) array
    changed : (N,) mask
    """
    candidates = _candidates(camera, anchor, views, positions)
    errors = _squared_errors(camera, anchor, candidates, views, positions, gross_px)
    now = _squared_errors(camera, anchor, directions[:, None], views, positions, gross_px)[:, 0]
    best = errors.argmin(axis=1)
    rows = np.arange(len(best))
    changed = errors[rows, best] < now
    chosen = np.where(changed[:, None], candidates[rows, best], directions)
    return chosen, changed


def _candidates(camera: Camera, anchor: Array, views: TargetViews, positions: Array) -> Array:
    """Directions ``(N, 2 (M - 1), 3)``: each far marker's ray cut with its sphere, twice."""
    rays = normalised(camera.unproject(views.uv[:, 1:]))
    radii = positions[1:]
    foot = rays @ anchor
    half_chord = np.sqrt(np.maximum(foot**2 - anchor @ anchor + radii**2, 0.0))
    depths = np.stack([foot - half_chord, foot + half_chord], axis=-1)
    offsets = depths[..., None] * rays[:, :, None, :] - anchor
    return normalised(offsets).reshape(len(views), -1, 3)


def _squared_errors(
    camera: Camera,
    anchor: Array,
    directions: Array,
    views: TargetViews,
    positions: Array,
    gross_px: float,
) -> Array:
    """Sum of squared residuals ``(N, C)`` of C poses a view; infinite for impossible ones."""
    points = anchor + positions[:, None] * directions[:, :, None, :]
    errors = np.sum((camera.project(points) - views.uv[:, None]) ** 2, axis=-1)
    errors = np.where(views.seen[:, None, :], np.nan_to_num(errors, nan=np.inf), 0.0)
    return np.minimum(errors, gross_px**2).sum(axis=-1)
