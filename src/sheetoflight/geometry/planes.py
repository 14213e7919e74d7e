"""Planes ``n · X = d`` and the rays that meet them."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array


def fitted_plane(points: Array) -> tuple[Array, float]:
    """Total least-squares plane through points ``(N, 3)``.

    Returns
    -------
    normal : (3,) unit vector, and distance : float
        With ``normal · X = distance`` and ``distance >= 0``.
    """
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    distance = float(normal @ centre)
    return (normal, distance) if distance >= 0 else (-normal, -distance)


def ray_depths(rays: Array, normal: Array, distance: float) -> Array:
    """Factor ``t`` with which each ray ``(..., 3)`` meets the plane: ``n · (t r) = d``.

    NaN where the ray is parallel to the plane or meets it behind the origin.
    """
    slope = rays @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = distance / slope
    return np.where((depths > 0) & np.isfinite(depths), depths, np.nan)
