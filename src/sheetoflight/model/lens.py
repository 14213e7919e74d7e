"""Brown's lens distortion and its inverse, on separate arrays of x and y.

One array for each coordinate, not pairs: every step then runs through memory in order, which is
what makes a million pixels cheap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sheetoflight.geometry.directions import Array

Coefficients = tuple[float, float, float, float, float]
"""``(k1, k2, p1, p2, k3)``."""

CHUNK = 8192
"""Points worked on at a time: some dozens of arrays of these stay in a core's cache."""

_QUICK_STEPS = 8
_SLOW_STEPS = 42
_CONVERGED = 1e-13
_REACHED = 1e-10


class Bent(NamedTuple):
    """Coordinates ``(...)``, and the derivatives of the distorted ones by the ideal ones.

    The derivative of x' by y is that of y' by x, so there are three.
    """

    x: Array
    y: Array
    xx: Array
    xy: Array
    yy: Array


def distorted(coefficients: Coefficients, x: Array, y: Array) -> tuple[Array, Array]:
    """Distorted coordinates of ideal ones, by the formulas of `sheetoflight.model.camera`."""
    k1, k2, p1, p2, k3 = coefficients
    x2, y2, xy2 = x * x, y * y, 2.0 * x * y
    r2 = x2 + y2
    factor = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        factor * x + p1 * xy2 + p2 * (r2 + 2.0 * x2),
        factor * y + p1 * (r2 + 2.0 * y2) + p2 * xy2,
    )


def distorted_with_jacobian(coefficients: Coefficients, x: Array, y: Array) -> Bent:
    """`distorted`, and its derivatives."""
    k1, k2, p1, p2, k3 = coefficients
    x2, y2, xy2 = x * x, y * y, 2.0 * x * y
    r2 = x2 + y2
    factor = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    return Bent(
        factor * x + p1 * xy2 + p2 * (r2 + 2.0 * x2),
        factor * y + p1 * (r2 + 2.0 * y2) + p2 * xy2,
        factor + 2.0 * (slope * x2 + p1 * y + 3.0 * p2 * x),
        slope * xy2 + 2.0 * (p1 * x + p2 * y),
        factor + 2.0 * (slope * y2 + 3.0 * p1 * y + p2 * x),
    )


def undistorted(coefficients: Coefficients, x: Array, y: Array) -> Bent:
    """Ideal coordinates of distorted ones ``(N,)``, NaN where the distortion has no inverse.

    Newton's iteration with the analytic Jacobian. It begins at the distorted coordinates: where
    the lens draws in they lie nearer to the centre than the ideal ones, and Newton's steps on the
    concave curve of the radius never pass its turning point.
    """
    with np.errstate(all="ignore"):  # beyond the turning point it runs away
        found, off, moving = _newton(coefficients, (x, y), (x, y), _QUICK_STEPS)
        if moving.any():  # few: near the turning point, or beyond it
            aim, begin = (x[moving], y[moving]), (found.x[moving], found.y[moving])
            slow, slow_off, _ = _newton(coefficients, aim, begin, _SLOW_STEPS)
            for whole, part in zip((*found, off), (*slow, slow_off), strict=True):
                whole[moving] = part
        bad = ~(off < _REACHED)
        bad |= ~(found.xx * found.yy > found.xy * found.xy)
        bad |= ~(found.xx > 0)
    if bad.any():
        found.x[bad] = found.y[bad] = np.nan
    return found


def _newton(
    coefficients: Coefficients, aim: tuple[Array, Array], begin: tuple[Array, Array], steps: int
) -> tuple[Bent, Array, Array]:
    """Where the steps lead, by how much the last one's start missed, and what still moved."""
    x, y = begin
    for _ in range(steps):
        image = distorted_with_jacobian(coefficients, x, y)
        off_x, off_y = aim[0] - image.x, aim[1] - image.y
        scale = 1.0 / (image.xx * image.yy - image.xy * image.xy)
        step_x = (image.yy * off_x - image.xy * off_y) * scale
        step_y = (image.xx * off_y - image.xy * off_x) * scale
        x, y = x + step_x, y + step_y
        moving = np.maximum(np.abs(step_x), np.abs(step_y)) > _CONVERGED
        if not moving.any():
            break
    off = np.maximum(np.abs(off_x), np.abs(off_y))
    return Bent(x, y, image.xx, image.xy, image.yy), off, moving
