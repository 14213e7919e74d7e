"""Poses and points from tracks, for a camera of which K is guessed: where an adjustment begins.

R. Hartley and A. Zisserman, *Multiple View Geometry*, 2nd ed., 2003: two views by their essential
matrix (section 9.6), points by linear triangulation (section 12.2), further views by the direct
linear transform (section 7.1).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sheetoflight.calibration.solid_closed_form import solid_pose
from sheetoflight.calibration.track_adjustment import TrackState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera

_FEWEST_SHARED = 6
_MOST_PARALLAX = 0.5
"""Radians; more is no better for a first pair."""

_QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def started(
    tracks: Array, camera: Camera, fundamentals: Mapping[tuple[int, int], Array]
) -> TrackState | None:
    """Poses of all views and places of all tracks.

    Parameters
    ----------
    tracks : (V, T, 2) array
        Image points, px; NaN where not seen.
    camera : Camera
        A guess, without distortion.
    fundamentals : mapping from (second, first) view to (3, 3) array
        ``x_secondᵀ F x_first = 0``, px.

    Returns
    -------
    TrackState, or None
        In the gauge of the first view at rest, all translations in a common unit; tracks that
        could not be placed in front of all their views are NaN. None where the views do not hang
        together.
    """
    xy = camera.unproject(tracks)[..., :2]
    pairs = [(pair, _two_views(xy, pair, camera.matrix, F)) for pair, F in fundamentals.items()]
    (second, first), (pose, parallax) = max(pairs, key=lambda item: item[1][1])
    if parallax <= 0:
        return None
    poses = np.full((len(tracks), 3, 4), np.nan)
    poses[first], poses[second] = np.eye(3, 4), pose
    while np.isnan(poses[:, 0, 0]).any():
        points = triangulated(poses, xy)
        shared = np.isfinite(points[:, 0]) & np.isfinite(xy[..., 0])
        count = np.where(np.isnan(poses[:, 0, 0]), shared.sum(axis=1), 0)
        view = int(count.argmax())
        placed = solid_pose(points[shared[view]], xy[view, shared[view]])
        if count[view] < _FEWEST_SHARED or placed is None:
            return None
        poses[view] = placed
    poses = _from_first(poses)
    return TrackState(camera, poses[..., :3], poses[..., 3], triangulated(poses, xy))


def _two_views(xy: Array, pair: tuple[int, int], K: Array, F: Array) -> tuple[Array, float]:
    """Pose ``(3, 4)`` of the second view from the first, and a mark that grows with the number
    of points placed and their parallax."""
    second, first = pair
    u, _, vt = np.linalg.svd(K.T @ F @ K)
    u, vt = u * np.linalg.det(u), vt * np.linalg.det(vt)
    both = xy[[first, second]]
    best, most = np.eye(3, 4), 0.0
    for turn in (u @ _QUARTER @ vt, u @ _QUARTER.T @ vt):
        for shift in (u[:, 2], -u[:, 2]):
            pose = np.column_stack([turn, shift])
            points = triangulated(np.stack([np.eye(3, 4), pose]), both)
            mark = float(np.nansum(np.minimum(_parallax(points, pose), _MOST_PARALLAX)))
            if mark > most:
                best, most = pose, mark
    return best, most


def _parallax(points: Array, pose: Array) -> Array:
    """Angle ``(T,)`` at each point between two views, rad."""
    centre = -pose[:, :3].T @ pose[:, 3]
    other = points - centre
    across = np.linalg.norm(np.cross(points, other), axis=1)
    return np.arctan2(across, np.sum(points * other, axis=1))


def triangulated(poses: Array, xy: Array) -> Array:
    """Points ``(T, 3)`` from normalised images ``(V, T, 2)`` in views of known poses.

    NaN where fewer than two views with a pose see a point, or it lies behind one that does. The
    null vector of ``x (p3 · X) − p1 · X = 0``, ``y (p3 · X) − p2 · X = 0`` (*Multiple View
    Geometry*, section 12.2).
    """
    seen = np.isfinite(xy[..., 0]) & np.isfinite(poses[:, 0, 0])[:, None]
    known, image = np.nan_to_num(poses), np.where(seen[..., None], xy, 0.0)
    rows = image[..., None] * known[:, None, None, 2] - known[:, None, :2]
    rows = np.where(seen[..., None, None], rows, 0.0)
    stacked = np.swapaxes(rows, 0, 1).reshape(xy.shape[1], -1, 4)
    whole = np.linalg.svd(stacked, full_matrices=False)[2][:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        points = whole[:, :3] / whole[:, 3:]
        depth = np.einsum("vj,tj->vt", known[:, 2, :3], points) + known[:, 2, 3:]
    good = np.isfinite(points).all(axis=1) & ((depth > 0) | ~seen).all(axis=0)
    return np.where((good & (seen.sum(axis=0) >= 2))[:, None], points, np.nan)


def _from_first(poses: Array) -> Array:
    """Poses with the first view at rest."""
    rotations = poses[..., :3] @ poses[0, :, :3].T
    translations = poses[..., 3] - rotations @ poses[0, :, 3]
    return np.concatenate([rotations, translations[..., None]], axis=2)
