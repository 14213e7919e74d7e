"""Where a view's pose puts its markers, and how they move: all that differs between the stages.

The pivoting target is ``A + s t``. A target lying in a sheet of light, whose frame is
``(e1, e2, n)``, is ``d n + x e1 + y e2 + s (cos ψ e1 + sin ψ e2)``. A target that crosses a sheet
is ``C + (s − s_C) t``, and the laser's spot on it is where ``n · X = d``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.rig_state import ANCHOR, RigState, sheet_names
from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.observations import TargetViews


@dataclass(frozen=True)
class Placement:
    """Points of N views in the camera frame, and how they move.

    Parameters
    ----------
    points : (N, M, 3) array
        mm; in stage crossing the spots follow the markers.
    by_local : (N, M, 3, k) array
        By the view's own parameters.
    by_shared : (N, M, 3, s) array
        By the shared parameters other than the camera's.
    along : (N, 3) array
        Direction of the target.
    """

    points: Array
    by_local: Array
    by_shared: Array
    along: Array


def _pivoting(state: RigState, positions: Array, _: TargetViews) -> Placement:
    directions = state.poses["camera"]
    first, second = tangent_basis(directions)
    tangents = np.stack([first, second], axis=-1)
    by_local = positions[:, None, None] * tangents[:, None]
    points = state.anchor + positions[:, None] * directions[:, None, :]
    by_shared = np.broadcast_to(np.eye(3), (*points.shape, 3))
    return Placement(points, by_local, by_shared, directions)


def _lying(state: RigState, positions: Array, views: TargetViews) -> Placement:
    pose, lasers = state.poses["plane"], views.lasers
    e1, e2, normal = state.frames[lasers].transpose(2, 0, 1)[:, :, None, :]
    distance = state.distances[lasers][:, None, None]
    cosine, sine = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    x = (pose[:, :1] + positions * cosine)[..., None]
    y = (pose[:, 1:2] + positions * sine)[..., None]
    points = x * e1 + y * e2 + distance * normal

    by_local = np.empty((*points.shape, 3))
    by_local[..., 0] = e1
    by_local[..., 1] = e2
    across = cosine[..., None] * e2 - sine[..., None] * e1
    by_local[..., 2] = positions[:, None] * across

    own = np.empty((*points.shape, 3))
    own[..., 0] = distance * e1 - x * normal
    own[..., 1] = distance * e2 - y * normal
    own[..., 2] = normal
    along = cosine * e1[:, 0] + sine * e2[:, 0]
    return Placement(points, by_local, _spread(own, lasers, len(state.distances)), along)


def _spread(own: Array, lasers: np.ndarray, count: int) -> Array:
    """Derivatives by each view's own sheet, put into the columns of all sheets."""
    if count == 1:
        return own
    every = np.zeros((*own.shape[:3], count, 3))
    every[np.arange(len(own)), :, :, lasers] = own
    return every.reshape(*own.shape[:3], 3 * count)


def _crossing(state: RigState, positions: Array, views: TargetViews) -> Placement:
    middle, along = state.poses["crossing"][:, :3], state.poses["crossing"][:, 3:]
    offsets = positions - positions.mean()
    markers, lasers = len(positions), len(state.distances)
    seen = views.seen[:, markers:]
    normals = state.frames[:, :, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(seen, along @ normals.T, 1.0)
        reach = np.where(seen, (state.distances - middle @ normals.T) / slope, 0.0)
    places = np.concatenate([np.broadcast_to(offsets, (len(middle), markers)), reach], axis=1)
    points = middle[:, None] + places[..., None] * along[:, None]

    tangents = np.stack(tangent_basis(along), axis=-1)
    by_local = np.empty((*points.shape, 5))
    by_local[..., :3] = np.eye(3)
    by_local[..., 3:] = places[..., None, None] * tangents[:, None]
    by_shared = np.zeros((*points.shape, 3 * lasers))
    for laser in range(lasers):
        spot = markers + laser
        e1, e2, normal = state.frames[laser].T
        # the spot slides along the target so as to stay in the sheet
        slide = along / slope[:, laser, None]
        by_local[:, spot] -= slide[:, :, None] * (normal @ by_local[:, spot])[:, None, :]
        change = np.stack(
            [-points[:, spot] @ e1, -points[:, spot] @ e2, np.ones(len(points))], axis=-1
        )
        by_shared[:, spot, :, 3 * laser : 3 * laser + 3] = slide[:, :, None] * change[:, None, :]
    return Placement(points, by_local, by_shared, along)


_PLACEMENTS: Mapping[str, Callable[[RigState, Array, TargetViews], Placement]] = {
    "camera": _pivoting,
    "plane": _lying,
    "crossing": _crossing,
}


def placed(state: RigState, stage: str, positions: Array, views: TargetViews) -> Placement:
    """The points of one stage's views.

    Parameters
    ----------
    state : RigState
    stage : {"camera", "plane", "crossing"}
    positions : (M,) array
        Marker positions along the target, mm.
    views : TargetViews
    """
    return _PLACEMENTS[stage](state, positions, views)


def placement_names(stage: str, lasers: int) -> tuple[str, ...]:
    """The shared parameters that `Placement.by_shared` is by."""
    return ANCHOR if stage == "camera" else sheet_names(lasers)
