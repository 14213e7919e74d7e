"""The pieces of the laser line in one picture, their centres and their ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres
from sheetoflight.imaging.stripe.colour import laser_light
from sheetoflight.imaging.stripe.ends import line_ends
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.lines import LineOptions, found_lines, other_centres
from sheetoflight.model.line_piece import LinePiece

_LEAST_CENTRES = 5


def line_pieces(
    image_on: NDArray[Any],
    image_off: NDArray[Any] | None = None,
    options: LineOptions | None = None,
) -> tuple[LinePiece, ...]:
    """Find the pieces of the laser line.

    Parameters
    ----------
    image_on : (H, W) or (H, W, 3) array
        Picture with the laser on; uint8, uint16 or float.
    image_off : array of the same shape and type, optional
        Picture of the same scene with the laser off.
    options : LineOptions, optional

    Returns
    -------
    tuple of LinePiece
        From top to bottom, then from left to right of the first end. The first end is the upper
        one of a steep piece, the left one of a flat one. Where no clear edge ends the piece (it
        leaves the picture, fades, or goes on round a sharp bend) the end is where its light
        was last followed to, the end's standard uncertainty is NaN, and the piece is not whole.

    Raises
    ------
    InputError
        If a picture is no picture, or the two do not match.
    """
    options = options or LineOptions()
    light = laser_light(image_on, image_off)
    runs = found_lines(light, options)
    pieces = [_piece(light, run, other_centres(runs, i)) for i, run in enumerate(runs)]
    long_enough = [piece for piece in pieces if len(piece) >= _LEAST_CENTRES]
    return tuple(sorted(long_enough, key=lambda piece: (piece.ends[0, 1], piece.ends[0, 0])))


def _piece(light: LineLight, run: Centres, others: Array) -> LinePiece:
    first, last, inner = line_ends(light, run, others)
    return LinePiece(
        uv=run.uv[inner],
        std=run.std[inner],
        ends=np.stack([first.uv, last.uv]),
        ends_std=np.array([first.std, last.std]),
        whole=first.seen and last.seen,
    )
