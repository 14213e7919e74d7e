"""The image of a circle's centre, which is not the middle of the ellipse that it becomes."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.homography import plane_to_picture
from sheetoflight.model.board import PlanarBoard

_ROUNDS = 3


def centres_of(middles: Array, frames: Array, board: PlanarBoard) -> Array:
    """Images ``(M, 2)`` px of circles' centres, from the ellipses that the circles become.

    A circle's centre is the pole of the line at infinity of its plane, and poles go with the
    picture (Hartley and Zisserman, "Multiple View Geometry", 2nd ed., section 2.8). So the image
    of the centre is ``C* l``, l the board's vanishing line ``H⁻ᵀ (0, 0, 1)`` and C* the ellipse's
    dual conic ``T diag(1, 1, −1) Tᵀ``, T the map of the unit circle to the ellipse. H follows from
    the centres: the two are iterated. The circles' diameter is not needed.

    Parameters
    ----------
    middles : (M, 2) array
        Middles of the ellipses, px; NaN where not seen.
    frames : (M, 2, 2) array
        Map the unit circle to each ellipse about its middle.
    board : PlanarBoard
    """
    maps = np.zeros((len(middles), 3, 3))
    maps[:, :2, :2], maps[:, :2, 2], maps[:, 2, 2] = frames, middles, 1.0
    dual = maps @ np.diag([1.0, 1.0, -1.0]) @ np.swapaxes(maps, 1, 2)
    centres = middles
    for _ in range(_ROUNDS):
        matrix = plane_to_picture(board, centres)
        if matrix is None:
            return middles
        pole = dual @ np.linalg.inv(matrix)[2]
        centres = pole[:, :2] / pole[:, 2:]
    return centres
