"""How well a corner of a chessboard looks like one: dark and light across it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.grey import GreyPicture, Picture

_PLACES = np.array([0.15, 0.25, 0.35])
"""Where a quarter is read, in steps of the grid from the corner."""

_LEAST_CONTRAST_IN_NOISE = 3.0


def saddles(picture: GreyPicture, uv: Array, a: Array, b: Array) -> Array:
    """Share ``(...)`` of the local contrast that is that of a saddle: 1 or −1 at a corner between
    four squares, ±0.5 on the board's border, 0 on plain ground.

    Positive where the quarters along ``a + b`` and against it are the bright ones.

    Parameters
    ----------
    picture : GreyPicture
    uv, a, b : (..., 2) array
        Corners, and the steps from each to the next column and the next row, px.
    """
    quarter = {
        (i, j): _brightness(picture.values, uv, i * a, j * b) for i in (1, -1) for j in (1, -1)
    }
    saddle = (quarter[1, 1] + quarter[-1, -1] - quarter[1, -1] - quarter[-1, 1]) / 2
    values = np.stack(list(quarter.values()))
    least = _LEAST_CONTRAST_IN_NOISE * picture.noise
    return saddle / np.maximum(np.ptp(values, axis=0), least)


def middle_excess(picture: GreyPicture, uv: Array, a: Array, b: Array) -> Array:
    """Brightness ``(...)`` of each corner itself, above the mean of its darkest and brightest
    quarter, as a share of their difference: near 0 at a corner, 0.5 and more under a line of light.

    Parameters as of `saddles`.
    """
    quarters = np.stack(
        [_brightness(picture.values, uv, i * a, j * b) for i in (1, -1) for j in (1, -1)]
    )
    low, high = quarters.min(axis=0), quarters.max(axis=0)
    least = _LEAST_CONTRAST_IN_NOISE * picture.noise
    return (read_at(picture.values, uv) - (low + high) / 2) / np.maximum(high - low, least)


def alternating(saddle: Array) -> Array:
    """Saddles ``(rows, columns)`` with every other one's sign turned, as a chessboard's are."""
    row, column = np.indices(saddle.shape)
    return saddle * (-1.0) ** (row + column)


def _brightness(values: Picture, uv: Array, a: Array, b: Array) -> Array:
    """Mean grey value of the quarter between two steps."""
    places = [uv + s * a + t * b for s in _PLACES for t in _PLACES]
    return read_at(values, np.stack(places)).mean(axis=0)


def read_at(values: Picture, uv: Array) -> Array:
    """Grey values at image points ``(..., 2)``, between pixels by linear interpolation."""
    return map_coordinates(values, [uv[..., 1], uv[..., 0]], float, order=1, mode="nearest")
