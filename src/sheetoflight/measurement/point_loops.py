"""Image points to points in space with their variances, compiled: for very many of them.

What `triangulate_with_jacobians` does with arrays of derivatives is done here a block of points at
a time, in loops over the block that the compiler turns into vector instructions. To be imported
only where so much is to be done that loading numba pays; it compiles once and is kept on disk.

With ``s = n · r``, ``r = (x, y, 1)`` and ``t = d/s`` a point is ``X = t r``, so that::

    dX = t dr + r dt,    dt/t = dd/d − (n · dr + r · dn)/s,    (dx, dy) = J⁻¹ (dx', dy')

J the symmetric derivative of the distortion. A calibration's share of a coordinate's variance is
``b Σ bᵀ = ‖b L‖²`` with ``Σ = L Lᵀ``, b the derivatives by camera and plane.

A curved sheet's depth t is the root of a quadratic (`SheetCurvature.depths`), and its own normal at
the point takes the place of n in the derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.light_plane import LightPlane

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


def rows_of(factor: Array, alpha: float, beta: float) -> Array:
    """L ``(14 or 17, R)`` of camera and sheet as `fill_points` wants it: transposed, with the
    signs and divisors in it that all points share."""
    scale = np.ones(len(factor))
    scale[[0, 2, 3]], scale[[1, 4]], scale[13:] = 1.0 / alpha, 1.0 / beta, -1.0
    return np.ascontiguousarray((factor * scale[:, None]).T)


def sheet_of(plane: LightPlane) -> Array:
    """A sheet as `fill_points` wants it: normal and distance, and of a curved one
    ``Aᵀ centre``, A row by row, and kxx, kxy, kyy."""
    flat = [*plane.normal, plane.distance_mm]
    bend = plane.curvature
    if bend is None:
        return np.array(flat)
    return np.array([*flat, *(bend.centre @ bend.axes), *bend.axes.ravel(), *bend.per_mm])


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
def _meet(sheet, ray, depth, per_slope, normal):
    """Depths, NaN where there is none; the normal n, and ``1/(n · r)``."""
    n_x, n_y, n_z, distance = sheet[0], sheet[1], sheet[2], sheet[3]
    for j in range(_BLOCK):
        inverse = 1.0 / (n_x * ray[0, j] + n_y * ray[1, j] + n_z)
        depth[j], per_slope[j] = distance * inverse, inverse
        normal[0, j], normal[1, j] = n_x, n_y


@_compiled
def _meet_curved(sheet, ray, depth, per_slope, normal, bend):
    """What `_meet` finds, of a curved sheet, whose normal is its gradient at the point; and the
    derivatives ½ x², x y, ½ y² of its height over the plane."""
    n_x, n_y, n_z, distance = sheet[0], sheet[1], sheet[2], sheet[3]
    c_x, c_y, a_xx, a_xy, a_yx, a_yy, a_zx, a_zy, xx, xy, yy = sheet[4:15]
    k_x, k_y = xx * c_x + xy * c_y, xy * c_x + yy * c_y
    c = distance + 0.5 * (c_x * k_x + c_y * k_y)
    for j in range(_BLOCK):
        x, y = ray[0, j], ray[1, j]
        m_x, m_y = a_xx * x + a_yx * y + a_zx, a_xy * x + a_yy * y + a_zy
        a = xx * m_x * m_x + 2.0 * xy * m_x * m_y + yy * m_y * m_y
        slope = n_x * x + n_y * y + n_z
        b = slope + m_x * k_x + m_y * k_y
        squared = b * b - 2.0 * a * c
        root = math.copysign(math.sqrt(squared) if squared >= 0.0 else math.nan, slope)
        t = 2.0 * c / (b + root) if b * slope >= 0.0 else (b - root) / a
        p_x, p_y = t * m_x - c_x, t * m_y - c_y
        q_x, q_y = xx * p_x + xy * p_y, xy * p_x + yy * p_y
        g_x, g_y = n_x - a_xx * q_x - a_xy * q_y, n_y - a_yx * q_x - a_yy * q_y
        g_z = n_z - a_zx * q_x - a_zy * q_y
        depth[j], per_slope[j] = t, 1.0 / (g_x * x + g_y * y + g_z)
        normal[0, j], normal[1, j] = g_x, g_y
        bend[0, j], bend[1, j], bend[2, j] = 0.5 * p_x * p_x, p_x * p_y, 0.5 * p_y * p_y


@_compiled
def _turn(jacobian, off, step, depth, per_slope, normal, turn):
    """Takes away what is no depth; turns J into t J⁻¹, and finds how the depth's own change with
    x' and y' moves the point along its ray."""
    for j in range(_BLOCK):
        xx, xy, yy = jacobian[0, j], jacobian[1, j], jacobian[2, j]
        determinant = xx * yy - xy * xy
        good = (xx > 0.0) & (determinant > 0.0) & ((off[j] < _REACHED) | (step[j] <= _CONVERGED))
        t, inverse = depth[j], per_slope[j]
        t = t if good & (t > 0.0) & (t < math.inf) else math.nan
        depth[j] = t
        scale = t / determinant
        xx, xy, yy = yy * scale, -xy * scale, xx * scale
        jacobian[0, j], jacobian[1, j], jacobian[2, j] = xx, xy, yy
        turn[0, j] = -(normal[0, j] * xx + normal[1, j] * xy) * inverse
        turn[1, j] = -(normal[0, j] * xy + normal[1, j] * yy) * inverse


@_compiled
def _derive(axis, shear, bent, ray, jacobian, turn, depth, per_slope, rows):
    """Derivatives of one coordinate by camera and plane, less what `rows_of` holds; then by x' and
    y', and the coordinate.

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
        rows[13, j] = along * per_slope[j]
        rows[14, j], rows[15, j], rows[16, j] = by_x, by_y, coordinate


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
def _add_curved_squares(factor, rows, bend, variance):
    """`_add_squares` of a curved sheet: b goes on with what its curvature moves."""
    for k in range(len(factor)):
        f = factor[k]
        for j in range(_BLOCK):
            total = f[14] * bend[0, j] + f[15] * bend[1, j] + f[16] * bend[2, j]
            total *= rows[13, j]
            for i in range(14):
                total += f[i] * rows[i, j]
            variance[j] += total * total


@_compiled
def fill_points(uv, steps, first, last, camera, sheet, factor, xyz, std_xyz, noise_std):
    """Fill rows `first` to `last` of `xyz` and `std_xyz` ``(N, 3)`` and `noise_std` ``(N,)``, mm.

    Parameters
    ----------
    uv, steps : (N, 2) arrays
        Image points, and one standard uncertainty of each across the line, px.
    first, last : int
    camera : tuple of 10 float
        `Camera.parameters`.
    sheet : (4,) or (15,) array
        `sheet_of` the sheet.
    factor : (R, 14) or (R, 17) array
        `rows_of` the covariance's factor.
    """
    alpha, beta, gamma, u_0, v_0 = camera[:5]
    bent, ray, turn = (np.zeros((2, _BLOCK)), np.empty((2, _BLOCK)), np.empty((2, _BLOCK)))
    noise, jacobian, rows = np.zeros((2, _BLOCK)), np.empty((3, _BLOCK)), np.empty((17, _BLOCK))
    normal, bend, curved = np.empty((2, _BLOCK)), np.empty((3, _BLOCK)), len(sheet) > 4
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
        if curved:
            _meet_curved(sheet, ray, depth, per_slope, normal, bend)
        else:
            _meet(sheet, ray, depth, per_slope, normal)
        _turn(jacobian, off, step, depth, per_slope, normal, turn)
        total[:] = 0.0
        for axis in range(3):
            _derive(axis, gamma / alpha, bent, ray, jacobian, turn, depth, per_slope, rows)
            for j in range(_BLOCK):
                variance[j] = (rows[14, j] * noise[0, j] + rows[15, j] * noise[1, j]) ** 2
                total[j] += variance[j]
            if curved:
                _add_curved_squares(factor, rows, bend, variance)
            else:
                _add_squares(factor, rows, variance)
            for j in range(count):
                xyz[start + j, axis] = rows[16, j]
                std_xyz[start + j, axis] = math.sqrt(variance[j])
        for j in range(count):
            noise_std[start + j] = math.sqrt(total[j])
