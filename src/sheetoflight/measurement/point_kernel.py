"""A few thousand image points to points in space with their variances, by camera and sheet.

The derivatives are those of `triangulate_with_jacobians`, on separate arrays of coordinates and
for the uncertain parameters only: `Σ = L Lᵀ` turns each coordinate's variance ``b Σ bᵀ`` into the
squared length of ``b L``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane

_ROUNDING = 1e-15
"""Eigenvalues of a correlation matrix below this are rounding, not variance."""


class Spots(NamedTuple):
    """N image points, each with the step in the image that its uncertainty is.

    Parameters
    ----------
    u, v : (N,) arrays
        px.
    step_u, step_v : (N,) arrays
        One standard deviation across the laser line, px.
    """

    u: Array
    v: Array
    step_u: Array
    step_v: Array


class Positions(NamedTuple):
    """Points in space, by coordinates.

    Parameters
    ----------
    xyz : (3, N) array
        mm; NaN where there is none.
    variance : (3, N) array
        Of each coordinate, mm².
    noise_variance : (N,) array
        Sum over the coordinates of the part that comes from the steps in the image, mm².
    """

    xyz: Array
    variance: Array
    noise_variance: Array


@dataclass(frozen=True, eq=False)
class Factor:
    """A covariance as ``L Lᵀ``, of those parameters that are uncertain.

    Parameters
    ----------
    rows : (K,) int array
        Which of the parameters they are.
    matrix : (K, R) array
        ``L``.
    """

    rows: NDArray[np.int64]
    matrix: Array


def factor_of(covariance: Array) -> Factor:
    """Factor of a positive semi-definite matrix ``(P, P)``.

    By the eigenvalues of the correlation matrix, so that the parameters' units do not matter.
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    rows = np.flatnonzero(std > 0)
    correlation = covariance[np.ix_(rows, rows)] / np.outer(std[rows], std[rows])
    values, vectors = np.linalg.eigh(correlation)
    kept = values > _ROUNDING * max(len(rows), 1)
    return Factor(rows, std[rows, None] * vectors[:, kept] * np.sqrt(values[kept]))


def camera_positions(
    camera: Camera, plane: LightPlane, factor: Factor, spots: Spots
) -> Positions:
    """Where the rays meet the sheet.

    With ``t = d / (n · r)`` and ``r = (x, y, 1)``, ``dX = t dr + r dt`` and
    ``dt/t = dd/d − (n · dr + r · dn)/(n · r)``; and dr follows from J (dx, dy) = d(x', y') − ∂k,
    J the derivative of the distortion and ∂k its change with the coefficients.
    """
    ideal = camera.ideal(spots.u, spots.v)
    (n_x, n_y, n_z), (x, y) = plane.normal, ideal[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_slope = 1.0 / (n_x * x + n_y * y + n_z)
        depth = plane.distance_mm * inverse_slope
        depth[~((depth > 0) & np.isfinite(depth))] = np.nan
        scale = depth / (ideal.xx * ideal.yy - ideal.xy * ideal.xy)
    xx, xy, yy = ideal.yy * scale, -ideal.xy * scale, ideal.xx * scale  # depth times J⁻¹
    z_x, z_y = (-inverse_slope * (n_x * a + n_y * b) for a, b in ((xx, xy), (xy, yy)))
    by_bent = (xx + x * z_x, xy + x * z_y), (xy + y * z_x, yy + y * z_y), (z_x, z_y)

    step_x = (spots.step_u - camera.gamma / camera.beta * spots.step_v) / camera.alpha
    step_y = spots.step_v / camera.beta
    variance = np.empty((3, x.size))
    for row, (by_x, by_y) in zip(variance, by_bent, strict=True):
        np.square(by_x * step_x + by_y * step_y, out=row)
    noise_variance = variance.sum(axis=0)
    if factor.matrix.size:
        _add_calibration(variance)
    return Positions(np.stack([x * depth, y * depth, depth]), variance, noise_variance)
