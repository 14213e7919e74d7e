"""Printed boards as surfaces of a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.simulation.board_lines import face_outlines
from sheetoflight.simulation.paint import Cells, Checker, Disc, Paint
from sheetoflight.simulation.scene import INK, Surface

Code = tuple[tuple[bool, ...], ...]
"""Cells of a coded marker, its frame among them: rows of what is painted black."""

_BORDER_SHARE = 0.5
"""Width of the white border beyond the outline, as a share of the smaller pitch."""


def board_border(board: PlanarBoard) -> float:
    """Width of the white paper beyond the board's outline, mm."""
    return _BORDER_SHARE * min(board.pitch_mm)


def board_surface(
    board: Board, rotation: Array, translation: Array, codes: Sequence[Code] = (), ink: float = INK
) -> Surface:
    """A white sheet with the board's pattern; its points are ``R X_board + t``.

    The first field of a chessboard, beyond its first corner, is black; so is that of a charuco
    board, whose markers are numbered row by row through the white fields, as OpenCV does since
    4.6.

    Parameters
    ----------
    board : PlanarBoard
    rotation : (3, 3) array, translation : (3,) array
        Of the board in the camera frame, mm.
    codes : sequence of codes
        A charuco board's markers in the order of their numbers, one for each white field.
    ink : float
        Reflectance of the black parts.

    Raises
    ------
    InputError
        If the board is a solid body, or too few codes are given.
    """
    if not isinstance(board, PlanarBoard):
        raise InputError("a solid body was to be painted", "only flat boards have a pattern")
    (outline,) = face_outlines(board)
    middle, border = outline.mean(axis=0), board_border(board)
    length, width = np.ptp(outline, axis=0)[:2] / 2.0 + border
    return Surface(
        centre=rotation @ middle + translation,
        axes=rotation[:, :2].T,
        half_length=float(length),
        half_width=float(width),
        paint=tuple(_pattern(board, middle, codes, ink)),
    )


def _pattern(board: PlanarBoard, middle: Array, codes: Sequence[Code], ink: float) -> list[Paint]:
    if board.kind == "circles":
        radius = board.circle_diameter / 2.0
        return [Disc(float(a), float(b), radius, ink) for a, b, _ in board.points - middle]
    fields = board.columns + 1, board.rows + 1
    squares: list[Paint] = [Checker(0.0, 0.0, board.pitch_mm, fields, ink)]
    return squares + (_markers(board, codes, ink) if board.kind == "charuco" else [])


def _markers(board: PlanarBoard, codes: Sequence[Code], ink: float) -> list[Paint]:
    """A coded marker in the middle of every white field."""
    row, column = np.divmod(np.arange((board.rows + 1) * (board.columns + 1)), board.columns + 1)
    white = (row + column) % 2 == 1
    if len(codes) < white.sum():
        raise InputError(
            f"the board has {white.sum()} markers, and {len(codes)} codes are given",
            "give a code for each white field, from a dictionary that is large enough",
        )
    a = board.pitch_mm[0] * (column[white] - board.columns / 2.0)
    b = board.pitch_mm[1] * (row[white] - board.rows / 2.0)
    return [
        Cells(float(x), float(y), board.marker_side, code, ink)
        for x, y, code in zip(a, b, codes, strict=False)
    ]
