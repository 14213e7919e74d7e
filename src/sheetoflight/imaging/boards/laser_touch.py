"""Points of a board that the laser line runs too near to."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.grid import outline, spacing
from sheetoflight.imaging.stripe.extraction import extract_stripe
from sheetoflight.model.stripe import Stripe

_MOST_PIXELS = 300_000
_SMALLEST_SIDE = 32
_SHORTEST_LINE = 2.0
"""Squares that a bright line on a board extends over if it is to be the laser's."""

_WIDEST_GAP = 2.0
"""Squares, over which a line is taken to go on between two places where it is seen."""

_LINE_WIDTHS = 2.0
"""Standard deviations of the line's profile that still bend a corner's slopes."""


def touched(image: NDArray[Any], grid: Array, uv: Array, reach: Array) -> NDArray[np.bool_]:
    """Which points' windows the laser line shines into.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        The picture itself: colour tells a laser line best.
    grid : (rows, columns, 2) array
        The board's points, all of them, if only roughly, px.
    uv : (M, 2) array
        Measured points, px; NaN where not seen.
    reach : (M,) array
        Half the side of each point's window, px.
    """
    nothing = np.zeros(len(uv), dtype=bool)
    low, high = _around(grid, image.shape)
    if (high - low).min() < _SMALLEST_SIDE:
        return nothing
    crop, size = _reduced(np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]]))
    stripe = extract_stripe(crop)
    square = spacing(grid)
    lines = [_line(stripe, n, size, low, square) for n in range(stripe.lines)]
    for line, width in lines:
        if np.ptp(line, axis=0).max(initial=0.0) > _SHORTEST_LINE * square:
            nothing |= _distance(uv, line) < reach + _LINE_WIDTHS * width
    return nothing


def _around(grid: Array, shape: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Upper left and lower right corner of the upright box about the board, in the picture."""
    corners = outline(grid)
    limit = np.array(shape[1::-1])
    low = np.clip(np.floor(corners.min(axis=0)), 0, limit).astype(np.int64)
    return low, np.clip(np.ceil(corners.max(axis=0)) + 1, 0, limit).astype(np.int64)


def _reduced(image: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """The image at half, quarter … size if it is large, and the width of its pixels."""
    size = 1.0
    while image.shape[0] * image.shape[1] > _MOST_PIXELS:
        image, size = np.asarray(cv2.pyrDown(image)), 2.0 * size
    return image, size


def _line(
    stripe: Stripe, number: int, size: float, low: NDArray[np.int64], square: float
) -> tuple[Array, float]:
    """Points ``(N, 2)`` px along one line without gaps, and its width."""
    own = stripe.line == number
    uv = size * stripe.uv[own] + low
    step = np.linalg.norm(np.diff(uv, axis=0), axis=1)
    filled = [uv]
    for i in np.flatnonzero((step > 2.0) & (step < _WIDEST_GAP * square)):
        share = np.linspace(0.0, 1.0, int(step[i]) + 2)[1:-1, None]
        filled.append((1.0 - share) * uv[i] + share * uv[i + 1])
    return np.concatenate(filled), size * float(np.median(stripe.width[own]))


def _distance(uv: Array, line: Array) -> Array:
    """Distance ``(M,)`` px of points from the nearest of a line's points; inf where not seen."""
    distance = np.linalg.norm(uv[:, None] - line[None], axis=-1).min(axis=1)
    return np.where(np.isfinite(distance), distance, np.inf)
