"""How well a corner of a chessboard looks like one: dark and light across it."""

from __future__ import annotations

import cv2
import numpy as np

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
    flat = uv.reshape(-1, 1, 2).astype(np.float32)
    read = cv2.remap(
        values, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(read, dtype=float).reshape(uv.shape[:-1])
