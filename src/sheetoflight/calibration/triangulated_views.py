"""Markers of whole views in space, by the paper's closed form."""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.target_triangulation import triangulated_targets
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.rig import Rig


def triangulated_views(rig: Rig, camera: Camera, stage: str) -> tuple[Array, np.ndarray]:
    """A, P, B of the views that show three markers, by the paper's closed form.

    Of more than three markers the first and the last seen and the one nearest their middle.

    Returns
    -------
    points : (V, 3, 3) array
        mm, camera frame.
    used : (V,) int array
        Which views those are.
    """
    views = rig.observations.stages().get(stage)
    markers = len(rig.target.markers_mm)
    if views is None:
        return np.empty((0, 3, 3)), np.empty(0, dtype=int)
    seen = views.seen[:, :markers]
    used = np.flatnonzero(seen.sum(axis=1) >= 3)
    if not len(used):
        return np.empty((0, 3, 3)), used
    chosen = triples(seen[used], rig.target.positions)
    uv = np.take_along_axis(views.uv[used], chosen[..., None], axis=1)
    places = rig.target.positions[chosen]
    l1, l2 = places[:, 1] - places[:, 0], places[:, 2] - places[:, 1]
    points = triangulated_targets(uv, l1, l2, camera)
    finite = np.isfinite(points).all(axis=(1, 2))
    return points[finite], used[finite]


def triples(seen: np.ndarray, positions: Array) -> np.ndarray:
    """First, middle and last of the markers that were seen ``(V, 3)``."""
    first, last = outer_markers(seen)
    middle = 0.5 * (positions[first] + positions[last])
    inner = seen.copy()
    rows = np.arange(len(seen))
    inner[rows, first] = inner[rows, last] = False
    off = np.where(inner, np.abs(positions - middle[:, None]), np.inf)
    return np.stack([first, off.argmin(axis=1), last], axis=1)


def outer_markers(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last marker that each view shows."""
    return seen.argmax(axis=1), seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
