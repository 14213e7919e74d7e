"""Where the adjustment of targets that a sheet of light crosses begins.

Three markers give a target's pose (paper 3.2), but badly where it is seen nearly end on, or far
away: noise may put a marker, or the spot of the laser, behind the camera. Such poses are replaced
by rougher ones from which an adjustment can begin.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.placements import placed
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.triangulated_views import outer_markers, triangulated_views, triples
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_SLANTS = np.radians(np.arange(-89.5, 90.0, 0.5))
"""Directions that are tried, from across the spot's ray."""


def with_crossings(rig: Rig, state: RigState) -> RigState:
    """The state with the poses of crossing targets, from the paper's triangulation; where noise
    has put a marker behind the camera, with both ends equally far away.

    Raises
    ------
    UntrustworthyError
        If a view shows fewer than three markers.
    """
    views = rig.observations.crossing
    if not len(views):
        return state
    points, used = triangulated_views(rig, state.camera, "crossing")
    if len(used) < len(views):
        missing = views.names[int(np.setdiff1d(np.arange(len(views)), used)[0])]
        raise UntrustworthyError(
            "crossing",
            f"view {missing} does not give its pose",
            "remove the view, or detect three of its markers",
        )
    along = normalised(points[:, 2] - points[:, 0])
    markers = len(rig.target.markers_mm)
    places = triples(views.seen[:, :markers], rig.target.positions)
    offsets = rig.target.positions[places].mean(axis=1) - rig.target.positions.mean()
    middle = points.mean(axis=1) - offsets[:, None] * along
    reach = 0.5 * float(rig.target.positions[-1])
    behind = middle[:, 2] <= reach * np.abs(along[:, 2])
    if behind.any():
        middle[behind], along[behind] = _equally_far(rig, state.camera, views.take(behind))
    return state.with_poses("crossing", np.concatenate([middle, along], axis=1))


def _equally_far(rig: Rig, camera: Camera, views: TargetViews) -> tuple[Array, Array]:
    """Middles and directions ``(N, 3)`` of targets whose outer seen markers are equally far from
    the camera: ``t ‖r2 − r1‖`` is the distance between them."""
    first, last = outer_markers(views.seen[:, : len(rig.target.markers_mm)])
    rows, positions = np.arange(len(views)), rig.target.positions
    rays = normalised(camera.unproject(views.uv))
    start, end = rays[rows, first], rays[rows, last]
    gap = positions[last] - positions[first]
    distance = gap / np.linalg.norm(end - start, axis=1)
    along = normalised(end - start)
    middle = positions.mean() - positions[first]
    return distance[:, None] * start + middle[:, None] * along, along


def spots(rig: Rig, state: RigState, laser: int) -> Array:
    """Where the targets are crossed by a laser ``(S, 3)``: the points of the targets nearest to
    the spots' rays."""
    views = rig.observations.crossing
    if not len(views):
        return np.empty((0, 3))
    rays = normalised(state.camera.unproject(views.uv[:, len(rig.target.markers_mm) + laser]))
    middle, along = np.split(state.poses["crossing"], 2, axis=1)
    # what of the target's direction the ray does not see end on
    across = along - np.sum(along * rays, axis=1, keepdims=True) * rays
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = -np.sum(middle * across, axis=1) / np.sum(across**2, axis=1)
    points = middle + reach[:, None] * along
    return points[np.isfinite(points).all(axis=1)]


def crossings_in_front(rig: Rig, state: RigState) -> RigState:
    """The state with crossing targets that meet their sheets in front of the camera: where the
    pose does not, through the point in which the spot's ray meets the sheet."""
    views, positions = rig.observations.crossing, rig.target.positions
    if not len(views):
        return state
    depth = placed(state, "crossing", positions, views).points[..., 2]
    behind = (views.seen & ~(depth > 0)).any(axis=1)
    if not behind.any():
        return state
    poses, there = poses_through_spots(state, positions, views)
    chosen = np.where((behind & there)[:, None], poses, state.poses["crossing"])
    return state.with_poses("crossing", chosen)


def poses_through_spots(
    state: RigState, positions: Array, views: TargetViews
) -> tuple[Array, np.ndarray]:
    """Middle and direction of targets through their spots in given sheets.

    With the spot's ray u and w across it in the plane in which the target is seen, a target
    through ``S = D u`` with slant θ is ``S + t (cos θ w + sin θ u)`` and meets the ray
    ``a (p u + q w)`` of a marker at ``t = a q / cos θ``, ``a = D / (p − q tan θ)``. The slant is
    that which puts the markers' distances nearest to the true ones; three markers leave one.

    Returns
    -------
    poses : (N, 6) array
    there : (N,) mask
        Views in which there is such a target in front of the camera.
    """
    markers, rows = len(positions), np.arange(len(views))
    seen, lasers = views.seen[:, :markers], views.seen[:, markers:].argmax(axis=1)
    first, last = outer_markers(seen)
    rays = normalised(state.camera.unproject(views.uv))
    spot, rays = rays[rows, markers + lasers], rays[:, :markers]
    chord = rays[rows, last] - rays[rows, first]
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = state.frames[lasers][:, :, 2]
        reach = state.distances[lasers] / np.sum(spot * normals, axis=1)
        across = normalised(chord - np.sum(chord * spot, axis=1, keepdims=True) * spot)
        p, q = (np.einsum("nmi,ni->nm", rays, axis)[..., None] for axis in (spot, across))
        scale = reach[:, None, None] / (p - q * np.tan(_SLANTS))  # (N, M, slants)
        t = scale * q / np.cos(_SLANTS)
    start = t[rows, first][:, None] + (positions - positions[first][:, None])[..., None]
    error = np.where(seen[..., None], (t - start) ** 2, 0.0).sum(axis=1)
    in_front = ((scale > 0) | ~seen[..., None]).all(axis=1)
    possible = in_front & np.isfinite(error)
    best = np.where(possible, error, np.inf).argmin(axis=1)
    slant = _SLANTS[best][:, None]
    along = np.cos(slant) * across + np.sin(slant) * spot
    middle = t[rows, first, best] + positions.mean() - positions[first]
    middle = reach[:, None] * spot + middle[:, None] * along
    return np.concatenate([middle, along], axis=1), possible[rows, best]
