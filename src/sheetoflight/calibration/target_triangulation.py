"""Markers in space from one picture of three collinear points: the paper's eqs. 14–18.

The printed equations hold some misprints (docs/paper.md lists them); what stands here was
derived again. The image points are first moved to their common line, because eqs. 15–17 hold
only for points that are exactly collinear.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.geometry.lines import on_common_line
from sheetoflight.model.camera import Camera


def triangulated_targets(uv: Array, l1: Array, l2: Array, camera: Camera) -> Array:
    """Points A, P, B of targets in the camera frame.

    Parameters
    ----------
    uv : (N, 3, 2) array
        Image points of A, P, B in px.
    l1, l2 : (N,) or scalar
        Distances ``|AP|`` and ``|PB|`` in mm.
    camera : Camera

    Returns
    -------
    (N, 3, 3) array
        A, P, B in mm.
    """
    ideal = camera.unproject(uv) @ camera.matrix.T
    line = on_common_line(ideal[..., :2])
    homogeneous = np.concatenate([line, np.ones_like(line[..., :1])], axis=-1)
    rays = normalised(homogeneous @ np.linalg.inv(camera.matrix).T)
    t1 = _tangent_between(rays[:, 0], rays[:, 1])
    t2 = _tangent_between(rays[:, 1], rays[:, 2])

    total = l1 + l2
    x_b = (l2 * total * t1) / np.hypot(total * t1 * t2, l2 * t1 - l1 * t2)
    y_b = -x_b * t2
    x_a = l1 * t2 / (l2 * t1) * x_b
    y_a = x_a * t1
    x_p = l1 * (t1 + t2) / (total * t1) * x_b
    distances = np.stack([np.hypot(x_a, y_a), x_p, np.hypot(x_b, y_b)], axis=-1)
    return distances[..., None] * rays


def _tangent_between(a: Array, b: Array) -> Array:
    """Tangent of the angle between rays, ``‖a × b‖ / (a · b)``: eq. 14 without its arccos."""
    return np.linalg.norm(np.cross(a, b), axis=-1) / np.sum(a * b, axis=-1)
