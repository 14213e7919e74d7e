"""Brown's lens distortion and its inverse, on separate arrays of x and y.

A million pixels are cheap where each step runs through memory in order, within a core's cache, and
no memory is asked for: one array for each coordinate, `CHUNK` points at a time, results written
into arrays that are used again and again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sheetoflight.geometry.directions import Array

Coefficients = tuple[float, float, float, float, float]
"""``(k1, k2, p1, p2, k3)``."""

CHUNK = 8192
"""Points that are best worked on at a time."""

ROOM = 11
"""Arrays of the points' size that `undistorted` works in."""

_QUICK_STEPS = 8
_SLOW_STEPS = 42
_CONVERGED = 1e-13
_REACHED = 1e-10


class Bent(NamedTuple):
    """Coordinates, and the derivatives of the distorted ones by the ideal ones.

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
    ``f = 1 + k1 r² + k2 r⁴ + k3 r⁶ + 2 p2 x + 2 p1 y`` drawn out of them::

        x' = f x + p2 r²        y' = f y + p1 r²
    """
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    factor = ((r2 * k3 + k2) * r2 + k1) * r2 + 1.0
    factor = factor + 2.0 * p2 * x + 2.0 * p1 * y
    return factor * x + p2 * r2, factor * y + p1 * r2


def distorted_with_jacobian(coefficients: Coefficients, x: Array, y: Array) -> Bent:
    """`distorted`, and its derivatives."""
    arrays = np.empty((9, *np.shape(x)))
    image = Bent(*arrays[:5])
    _bend(coefficients, x, y, image, arrays[5:])
    return image


def _bend(coefficients: Coefficients, x: Array, y: Array, image: Bent, room: Array) -> None:
    """Fill `image`, with four arrays of room.

    The derivatives of f by x and y are ``s x + 2 p2`` and ``s y + 2 p1`` with
    ``s = 2 k1 + 4 k2 r² + 6 k3 r⁴``, hence ``∂x'/∂x = f + s x² + 4 p2 x`` and so on.
    """
    k1, k2, p1, p2, k3 = coefficients
    r2, factor, slope, spare = room
    np.multiply(x, x, out=r2)
    r2 += np.multiply(y, y, out=spare)
    _polynomial(r2, (k3, k2, k1, 1.0), factor)
    _polynomial(r2, (6.0 * k3, 4.0 * k2, 2.0 * k1), slope)
    factor += np.multiply(x, 2.0 * p2, out=image.xx)
    factor += np.multiply(y, 2.0 * p1, out=image.yy)
    np.multiply(factor, x, out=image.x)
    np.add(image.x, np.multiply(r2, p2, out=spare), out=image.x)
    np.multiply(factor, y, out=image.y)
    np.add(image.y, np.multiply(r2, p1, out=spare), out=image.y)

    slope_x = np.multiply(slope, x, out=r2)
    slope *= y
    for diagonal, part, along in ((image.xx, slope_x, x), (image.yy, slope, y)):
        np.multiply(diagonal, 2.0, out=diagonal)
        np.add(diagonal, factor, out=diagonal)
        np.add(diagonal, np.multiply(part, along, out=spare), out=diagonal)
    np.multiply(slope_x, y, out=image.xy)
    np.add(image.xy, np.multiply(x, 2.0 * p1, out=spare), out=image.xy)
    np.add(image.xy, np.multiply(y, 2.0 * p2, out=spare), out=image.xy)


def _polynomial(at: Array, coefficients: tuple[float, ...], value: Array) -> None:
    """Fill `value` by Horner's scheme, the highest power's coefficient first."""
    np.multiply(at, coefficients[0], out=value)
    for coefficient in coefficients[1:-1]:
        value += coefficient
        value *= at
    value += coefficients[-1]


def undistorted(coefficients: Coefficients, x: Array, y: Array, room: Array | None = None) -> Bent:
    """Ideal coordinates of distorted ones ``(N,)``, NaN where the distortion has no inverse.

    Newton's iteration with the analytic Jacobian. It begins at the distorted coordinates: where
    the lens draws in they lie nearer to the centre than the ideal ones, and Newton's steps on the
    concave curve of the radius never pass its turning point.

    Parameters
    ----------
    coefficients : Coefficients
    x, y : (N,) arrays
    room : (ROOM, N) array, optional
        Where to work. The result lies in it.
    """
    room = np.empty((ROOM, x.size)) if room is None else room
    room[0], room[1] = x, y
    with np.errstate(all="ignore"):  # beyond the turning point it runs away
        found, off, step = _newton(coefficients, (x, y), room, _QUICK_STEPS)
        moving = step > _CONVERGED
        if moving.any():  # few: near the turning point, or beyond it
            slow_room = room[:, moving]
            aim = x[moving], y[moving]
            slow, slow_off, _ = _newton(coefficients, aim, slow_room, _SLOW_STEPS)
            for whole, part in zip((*found, off), (*slow, slow_off), strict=True):
                whole[moving] = part
        good = off < _REACHED
        good &= found.xx > 0
        good &= np.multiply(found.xx, found.yy, out=room[7]) > np.square(found.xy, out=room[8])
    if not good.all():
        room[:2, ~good] = np.nan
    return found


def _newton(
    coefficients: Coefficients, aim: tuple[Array, Array], room: Array, steps: int
) -> tuple[Bent, Array, Array]:
    """Where the steps from ``room[:2]`` lead; by how much the start of the last one missed, and
    how long it was."""
    x, y, xx, xy, yy, off_x, off_y = room[:7]
    image, spare = Bent(off_x, off_y, xx, xy, yy), room[7:]
    scale, step_x, step_y, part = spare
    for _ in range(steps):
        _bend(coefficients, x, y, image, spare)
        np.subtract(aim[0], off_x, out=off_x)
        np.subtract(aim[1], off_y, out=off_y)
        np.multiply(xx, yy, out=scale)
        scale -= np.multiply(xy, xy, out=part)
        np.divide(1.0, scale, out=scale)
        np.multiply(yy, off_x, out=step_x)
        step_x -= np.multiply(xy, off_y, out=part)
        step_x *= scale
        np.multiply(xx, off_y, out=step_y)
        step_y -= np.multiply(xy, off_x, out=part)
        step_y *= scale
        x += step_x
        y += step_y
        length = np.maximum(np.abs(step_x, out=step_x), np.abs(step_y, out=step_y), out=part)
        if not np.fmax.reduce(length, initial=0.0) > _CONVERGED:
            break
    off = np.maximum(np.abs(off_x, out=off_x), np.abs(off_y, out=off_y), out=off_x)
    return Bent(x, y, xx, xy, yy), off, length
