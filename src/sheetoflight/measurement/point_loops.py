"""Image points to points in space with their variances, compiled: for very many of them.

What `triangulate_with_jacobians` does with arrays of derivatives is done here a block of points at
a time, in loops over the block that the compiler turns into vector instructions. To be imported
only where so much is to be done that loading numba pays; it compiles once and is kept on disk.

With ``s = n · r``, ``r = (x, y, 1)`` and ``t = d/s`` a point is ``X = t r``, so that::

    dX = t dr + r dt,    dt/t = dd/d − (n · dr + r · dn)/s,    (dx, dy) = J⁻¹ (dx', dy')

J the symmetric derivative of the distortion. A calibration's share of a coordinate's variance is
``b Σ bᵀ = ‖b L‖²`` with ``Σ = L Lᵀ``, b the derivatives by camera and plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from sheetoflight.geometry.directions import Array

_BLOCK = 64
_STEPS = 50
_CONVERGED = 1e-11
_REACHED = 1e-10


def _compiled(function: Callable[..., Any]) -> Any:
    """Kept on disk, where there is a folder for that. Fused multiplication and addition is the
    only liberty taken with the formulas."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:
        return numba.njit(**options)(function)


def rows_of(factor: Array, alpha: float, beta: float, distance_mm: float) -> Array:
    """L ``(14, R)`` of camera and plane as `fill_points` wants it: transposed, with the signs
    and divisors in it that all points share."""
    scale = np.ones(14)
    scale[[0, 2, 3]], scale[[1, 4]] = 1.0 / alpha, 1.0 / beta
    scale[13] = -1.0 / distance_mm
    return np.ascontiguousarray((factor * scale[:, None]).T)


@_compiled
def _straighten(distortion, bent, ray, jacobian, off, step):
    """Newton's iteration of `sheetoflight.model.lens`, all points of the block together."""
    k1, k2, p1, p2, k3 = distortion
    for j in range(_BLOCK):
        ray[0, j], ray[1, j] = bent[0, j], bent[1, j]
    for _ in range(_STEPS):
        for j in range(_BLOCK):
            x, y = ray[0, j], ray[1, j]
            r2 = x * x + y * y
            slope = (6.0 * k3 * r2 + 4.0 * k2) * r2 + 2.0 * k1
            along_x, along_y = 2.0 * p2 * x, 2.0 * p1 * y
            factor = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0 + along_x + along_y
            off_x = bent[0, j] - (factor * x + p2 * r2)
            off_y = bent[1, j] - (factor * y + p1 * r2)
            xx = factor + slope * x * x + 2.0 * along_x
            yy = factor + slope * y * y + 2.0 * along_y
            xy = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
            scale = 1.0 / (xx * yy - xy * xy)
            step_x = (yy * off_x - xy * off_y) * scale
            step_y = (xx * off_y - xy * off_x) * scale
            ray[0, j], ray[1, j] = x + step_x, y + step_y
            jacobian[0, j], jacobian[1, j], jacobian[2, j] = xx, xy, yy
            off[j] = abs(off_x) + abs(off_y)
            step[j] = abs(step_x) + abs(step_y)
        moving = False
        for j in range(_BLOCK):
            moving = moving or step[j] > _CONVERGED
        if not moving:
            break


@_compiled
def _meet(plane, ray, jacobian, off, step, depth, per_slope, turn):
    """Depths, NaN where there is none; turns J into t J⁻¹, and finds how the depth's own change
    with x' and y' moves the point along its ray."""
    n_x, n_y, n_z, distance = plane
    for j in range(_BLOCK):
        x, y = ray[0, j], ray[1, j]
        xx, xy, yy = jacobian[0, j], jacobian[1, j], jacobian[2, j]
        determinant = xx * yy - xy * xy
        good = (xx > 0.0) & (determinant > 0.0) & ((off[j] < _REACHED) | (step[j] <= _CONVERGED))
        inverse = 1.0 / (n_x * x + n_y * y + n_z)
        t = distance * inverse
        t = t if good & (t > 0.0) & (t < math.inf) else math.nan
        depth[j], per_slope[j] = t, inverse
        scale = t / determinant
        xx, xy, yy = yy * scale, -xy * scale, xx * scale
        jacobian[0, j], jacobian[1, j], jacobian[2, j] = xx, xy, yy
        turn[0, j] = -(n_x * xx + n_y * xy) * inverse
        turn[1, j] = -(n_x * xy + n_y * yy) * inverse


@_compiled
def _derive(axis, shear, bent, ray, jacobian, turn, depth, per_slope, rows):
    """Derivatives of one coordinate by the fourteen parameters, less what `rows_of` holds; then
    by x' and y', and the coordinate.

    An image point stays where it is while a parameter moves: ``alpha dx' = −x' dalpha`` and so
    on, and the lens's coefficients move (x, y) by −J⁻¹ times what they do to (x', y').
    """
    for j in range(_BLOCK):
        x, y = ray[0, j], ray[1, j]
        along = x if axis == 0 else (y if axis == 1 else 1.0)
        by_x, by_y = along * turn[0, j], along * turn[1, j]
        if axis < 2:
            by_x += jacobian[axis, j]
            by_y += jacobian[axis + 1, j]
        coordinate = depth[j] * along
        by_v, radial = by_y - shear * by_x, by_x * x + by_y * y
        by_normal = coordinate * per_slope[j]
        r2, twice = x * x + y * y, 2.0 * x * y
        rows[0, j], rows[2, j], rows[3, j] = by_x * bent[0, j], by_x * bent[1, j], by_x
        rows[1, j], rows[4, j] = by_v * bent[1, j], by_v
        rows[5, j], rows[6, j], rows[9, j] = radial * r2, radial * r2 * r2, radial * r2 * r2 * r2
        rows[7, j] = by_x * twice + by_y * (r2 + 2.0 * y * y)
        rows[8, j] = by_x * (r2 + 2.0 * x * x) + by_y * twice
        rows[10, j], rows[11, j], rows[12, j] = by_normal * x, by_normal * y, by_normal
        rows[13, j] = coordinate
        rows[14, j], rows[15, j] = by_x, by_y


@_compiled
def _add_squares(factor, rows, variance):
    """Add the squared lengths of ``b L``."""
    for k in range(len(factor)):
        f = factor[k]
        for j in range(_BLOCK):
            first = f[0] * rows[0, j] + f[1] * rows[1, j] + f[2] * rows[2, j] + f[3] * rows[3, j]
            middle = f[4] * rows[4, j] + f[5] * rows[5, j] + f[6] * rows[6, j] + f[7] * rows[7, j]
            last = f[8] * rows[8, j] + f[9] * rows[9, j] + f[10] * rows[10, j]
            last += f[11] * rows[11, j] + f[12] * rows[12, j] + f[13] * rows[13, j]
            variance[j] += (first + middle + last) ** 2


@_compiled
def fill_points(uv, steps, first, last, camera, plane, factor, xyz, std_xyz, noise_std):
    """Fill rows `first` to `last` of `xyz` and `std_xyz` ``(N, 3)`` and `noise_std` ``(N,)``, mm.

    Parameters
    ----------
    uv, steps : (N, 2) arrays
        Image points, and one standard uncertainty of each across the line, px.
    first, last : int
    camera : tuple of 10 float
        `Camera.parameters`.
    plane : tuple of 4 float
        Normal and distance.
    factor : (R, 14) array
        `rows_of` the covariance's factor.
    """
    alpha, beta, gamma, u_0, v_0 = camera[:5]
    bent, ray, turn = (np.zeros((2, _BLOCK)), np.empty((2, _BLOCK)), np.empty((2, _BLOCK)))
    noise, jacobian, rows = np.zeros((2, _BLOCK)), np.empty((3, _BLOCK)), np.empty((16, _BLOCK))
    off, step, depth = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    per_slope, variance, total = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    for start in range(first, last, _BLOCK):
        count = min(_BLOCK, last - start)  # the rest of the last block holds other points again
        for j in range(count):
            y = (uv[start + j, 1] - v_0) / beta
            bent[0, j], bent[1, j] = (uv[start + j, 0] - u_0 - gamma * y) / alpha, y
            up = steps[start + j, 1] / beta
            noise[0, j], noise[1, j] = (steps[start + j, 0] - gamma * up) / alpha, up
        _straighten(camera[5:], bent, ray, jacobian, off, step)
        _meet(plane, ray, jacobian, off, step, depth, per_slope, turn)
        total[:] = 0.0
        for axis in range(3):
            _derive(axis, gamma / alpha, bent, ray, jacobian, turn, depth, per_slope, rows)
            for j in range(_BLOCK):
                variance[j] = (rows[14, j] * noise[0, j] + rows[15, j] * noise[1, j]) ** 2
                total[j] += variance[j]
            _add_squares(factor, rows, variance)
            for j in range(count):
                xyz[start + j, axis] = rows[13, j]
                std_xyz[start + j, axis] = math.sqrt(variance[j])
        for j in range(count):
            noise_std[start + j] = math.sqrt(total[j])
