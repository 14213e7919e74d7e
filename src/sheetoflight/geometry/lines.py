"""Straight lines in the plane, and points moved onto them."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array


def fitted_line(points: Array) -> tuple[Array, Array]:
    """Total least-squares line through point sets ``(..., N, 2)``.

    Returns
    -------
    centre, direction : (..., 2)
        A point of the line and its unit direction, which points from the first towards the
        last point of the set.
    """
    centre = points.mean(axis=-2)
    offsets = points - centre[..., None, :]
    _, _, vectors = np.linalg.svd(offsets, full_matrices=False)
    direction = vectors[..., 0, :]
    forward = np.sum((points[..., -1, :] - points[..., 0, :]) * direction, axis=-1)
    return centre, np.where(forward[..., None] < 0, -direction, direction)


def on_common_line(points: Array) -> Array:
    """Project point sets ``(..., N, 2)`` onto their total least-squares line."""
    centre, direction = fitted_line(points)
    offsets = points - centre[..., None, :]
    along = np.sum(offsets * direction[..., None, :], axis=-1, keepdims=True)
    return centre[..., None, :] + along * direction[..., None, :]
