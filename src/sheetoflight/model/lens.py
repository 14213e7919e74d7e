"""Brown's lens distortion and its inverse, on separate arrays of x and y.

One array for each coordinate, not pairs: every step then runs through memory in order, which is
what makes many pixels cheap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array

Coefficients = tuple[float, float, float, float, float]
"""``(k1, k2, p1, p2, k3)``."""

CHUNK = 8192
"""Points that are best worked on at a time: their arrays stay in a core's cache."""

_QUICK_STEPS = 8
_SLOW_STEPS = 42
_CONVERGED = 1e-11
"""Longest step after which the next would be rounding: steps shrink by their squares."""

_REACHED = 1e-10


class Bent(NamedTuple):
    """Distorted coordinates, and their derivatives by the ideal ones.

    The derivative of x' by y is that of y' by x, so there are three. All arrays of one shape.
    """

    x: Array
    y: Array
    xx: Array
    xy: Array
    yy: Array


def distorted(coefficients: Coefficients, x: Array, y: Array) -> tuple[Array, Array]:
    """Distorted coordinates of ideal ones.

    The formulas of `sheetoflight.model.camera` with the common factor
    ``f = 1 + k1 r² + k2 r⁴ + k3 r⁶ + 2 p1 y + 2 p2 x`` drawn out of them::

        x' = f x + p2 r²        y' = f y + p1 r²
    """
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    factor = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0
    factor = factor + (2.0 * p1 * y + 2.0 * p2 * x)
    return factor * x + p2 * r2, factor * y + p1 * r2


def distorted_with_jacobian(coefficients: Coefficients, x: Array, y: Array) -> Bent:
    """`distorted`, and its derivatives: those of f by x and y are ``s x + 2 p2`` and
    ``s y + 2 p1`` with ``s = 2 k1 + 4 k2 r² + 6 k3 r⁴``."""
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    factor = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0
    along_y, along_x = 2.0 * p1 * y, 2.0 * p2 * x
    factor = factor + (along_y + along_x)
    slope = (6.0 * k3 * r2 + 4.0 * k2) * r2 + 2.0 * k1
    slope_x = slope * x
    return Bent(
        factor * x + p2 * r2,
        factor * y + p1 * r2,
        factor + (slope_x * x + 2.0 * along_x),
        slope_x * y + (2.0 * p1 * x + 2.0 * p2 * y),
        factor + (slope * y * y + 2.0 * along_y),
    )


def by_coefficient(index: int, x: Array, y: Array) -> tuple[Array, Array]:
    """Derivatives of the distorted coordinates by k1, k2, p1, p2 or k3, numbered from 0."""
    r2 = x * x + y * y
    if index == 2:
        return 2.0 * x * y, r2 + 2.0 * y * y
    if index == 3:
        return r2 + 2.0 * x * x, 2.0 * x * y
    power = r2
    for _ in range({0: 0, 1: 1, 4: 2}[index]):
        power = power * r2
    return power * x, power * y


def undistorted(coefficients: Coefficients, x: Array, y: Array) -> tuple[Array, Array]:
    """Ideal coordinates of distorted ones ``(N,)``, NaN where the distortion has no inverse.

    Newton's iteration with the analytic Jacobian. It begins at the distorted coordinates: where
    the lens draws in they lie nearer to the centre than the ideal ones, and Newton's steps on the
    concave curve of the radius never pass its turning point.
    """
    with np.errstate(all="ignore"):  # beyond the turning point it runs away
        found = _newton(coefficients, (x, y), (x, y), _QUICK_STEPS)
        moving = found.step > _CONVERGED
        if moving.any():  # few: near the turning point, or beyond it
            aim, begin = (x[moving], y[moving]), (found.x[moving], found.y[moving])
            slow = _newton(coefficients, aim, begin, _SLOW_STEPS)
            for whole, part in zip(found, slow, strict=True):
                whole[moving] = part
    if not found.good.all():
        found.x[~found.good] = found.y[~found.good] = np.nan
    return found.x, found.y


class _Found(NamedTuple):
    """Where Newton's steps lead, how long the last one was, and whether that is an inverse."""

    x: Array
    y: Array
    step: Array
    good: NDArray[np.bool_]


def _newton(
    coefficients: Coefficients, aim: tuple[Array, Array], begin: tuple[Array, Array], steps: int
) -> _Found:
    x, y = begin
    while True:
        image = distorted_with_jacobian(coefficients, x, y)
        off_x, off_y = aim[0] - image.x, aim[1] - image.y
        determinant = image.xx * image.yy - image.xy * image.xy
        scale = 1.0 / determinant
        step_x = (image.yy * off_x - image.xy * off_y) * scale
        step_y = (image.xx * off_y - image.xy * off_x) * scale
        x, y = x + step_x, y + step_y
        step = np.maximum(np.abs(step_x), np.abs(step_y))
        steps -= 1
        if not steps or not np.any(step > _CONVERGED):
            break
    good = (np.maximum(np.abs(off_x), np.abs(off_y)) < _REACHED) | (step <= _CONVERGED)
    return _Found(x, y, step, good & (image.xx > 0.0) & (determinant > 0.0))
