"""Finding a chessboard's inner corners."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.corners import corner_std, refined, windows
from sheetoflight.imaging.boards.grid import (
    is_even,
    numberings,
    one_more,
    room,
    spacing,
    steps,
    upper_left_first,
)
from sheetoflight.imaging.boards.levels import EightBit, at_quick_size, shown
from sheetoflight.imaging.boards.other_size import inside, why_not_found
from sheetoflight.imaging.boards.saddles import alternating, middle_excess, saddles
from sheetoflight.imaging.boards.second_board import blanked, where
from sheetoflight.imaging.boards.sharpness import too_blurred
from sheetoflight.imaging.boards.sighting import FoundPoints
from sheetoflight.imaging.markers.grey import GreyPicture, Picture
from sheetoflight.imaging.markers.line_light import bridged
from sheetoflight.model.board import PlanarBoard

_ADAPTIVE = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
_THOROUGH = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE
_LEAST_SADDLE = 0.6
_LEAST_GOOD_SHARE = 0.75
_LEAST_SEEN_SHARE = 0.6
_MOST_EXCESS = 0.4
_FARTHEST_MOVE = 0.3


def find_chessboard(picture: GreyPicture, board: PlanarBoard) -> FoundPoints | str:
    """The inner corners of a chessboard, or why there are none.

    The numbering follows the right hand: x × y points away from the camera. Where the pattern
    itself tells its two ends apart (one side has an even, the other an odd number of squares),
    the corner square beside point 0 is the dark one; otherwise point 0 is the one nearest to the
    picture's upper left corner. A mirrored picture of a chessboard shows a chessboard: a single
    one cannot tell.

    Parameters
    ----------
    picture : GreyPicture
    board : PlanarBoard
        Of kind ``chessboard``.
    """
    grid = located(picture, board.columns, board.rows)
    if grid is None:
        return why_not_found(picture.values, board)
    grid = _numbered(picture, grid, board)
    doubt = _doubt(picture, grid, board)
    if doubt is not None:
        return doubt
    found = _measured(picture, grid)
    if np.isfinite(found.std).mean() < _LEAST_SEEN_SHARE:
        return why_not_found(picture.values, board)
    return found


def located(picture: GreyPicture, columns: int, rows: int) -> Array | None:
    """Rough corners ``(rows, columns, 2)`` px in any numbering, or None."""
    for form, size in shown(picture.values):
        grid = _located_in(form, size, columns, rows)
        if grid is not None:
            return grid
    # A laser line along a row of squares joins them; below it they may still be told apart.
    unlit = bridged(picture)
    if unlit is None:
        return None
    form, size = at_quick_size(unlit)
    return _located_in(form, size, columns, rows)


def _located_in(form: EightBit, size: float, columns: int, rows: int) -> Array | None:
    for finder in (_by_quads, _by_corners):
        corners = finder(form, columns, rows)
        if corners is not None:
            grid = size * corners.reshape(rows, columns, 2).astype(float)
            if is_even(grid):
                return grid
    return None


def _by_quads(form: EightBit, columns: int, rows: int) -> np.ndarray | None:
    found, corners = cv2.findChessboardCorners(form, (columns, rows), flags=_ADAPTIVE)
    return np.asarray(corners) if found else None


def _by_corners(form: EightBit, columns: int, rows: int) -> np.ndarray | None:
    """Duda and Frese, "Accurate detection and localization of checkerboard corners for
    calibration", British Machine Vision Conference 2018: bears distortion and bending."""
    found, corners = cv2.findChessboardCornersSB(form, (columns, rows), flags=_THOROUGH)
    return np.asarray(corners) if found else None


def _numbered(picture: GreyPicture, grid: Array, board: PlanarBoard) -> Array:
    """The numbering whose first corner square is dark, as far as the pattern tells."""
    choices = numberings(grid, board.columns, board.rows)
    first = [float(np.median(alternating(saddles(picture, g, *steps(g))))) for g in choices]
    # Of the corner's four quarters, the one against a + b is the corner square.
    dark = [g for g, sign in zip(choices, first, strict=True) if sign < 0]
    return upper_left_first(dark or choices)


def _doubt(picture: GreyPicture, grid: Array, board: PlanarBoard) -> str | None:
    """Why the grid that was found is not to be used."""
    saddle = alternating(saddles(picture, grid, *steps(grid)))
    if np.mean(saddle * np.sign(np.median(saddle)) > _LEAST_SADDLE) < _LEAST_GOOD_SHARE:
        return (
            f"a grid of corners about {where(grid)} is no chessboard: its squares are not dark "
            "and light by turns – light the board evenly, or hold it nearer"
        )
    blurred = too_blurred(picture.values, grid)
    if blurred is not None:
        return blurred
    if _goes_on(picture, grid):
        return (
            f"the board at {where(grid)} is larger than {board.columns} × {board.rows} corners – "
            "correct columns and rows in [board]: count the inner corners"
        )
    second = located_again(picture.values, grid, board)
    if second is not None:
        return (
            f"two boards are in the picture, at {where(grid)} and {where(second)} – leave one of "
            "them in view"
        )
    return None


def _goes_on(picture: GreyPicture, grid: Array) -> bool:
    """Whether there are corners where a further row or column would have them."""
    a, b = steps(grid)
    outward = ((a[0], b[0]), (a[-1], b[-1]), (a[:, 0], b[:, 0]), (a[:, -1], b[:, -1]))
    for uv, (along, down) in zip(one_more(grid), outward, strict=True):
        seen = inside(uv, picture.values.shape)
        saddle = np.abs(saddles(picture, uv, along, down))
        # A border of the board has half a saddle, if it has a white margin, or none.
        if seen.mean() > 0.5 and np.mean(saddle[seen] > 0.75) > 0.8:
            return True
    return False


def located_again(values: Picture, grid: Array, board: PlanarBoard) -> Array | None:
    """A second board of the same size beside the one found, in a quick look."""
    form, size = at_quick_size(blanked(values, grid))
    corners = _by_quads(form, board.columns, board.rows)
    if corners is None:
        found, sharp = cv2.findChessboardCornersSB(form, (board.columns, board.rows))
        corners = np.asarray(sharp) if found else None
    if corners is None:
        return None
    return size * corners.reshape(board.rows, board.columns, 2).astype(float)


def _measured(picture: GreyPicture, grid: Array) -> FoundPoints:
    window = windows(room(grid).ravel())
    rough = grid.reshape(-1, 2)
    uv = refined(picture, rough, window)
    std = corner_std(picture, uv, window)
    flat = [step.reshape(-1, 2) for step in steps(grid)]
    saddle = alternating(saddles(picture, uv, *flat).reshape(grid.shape[:2]))
    bad = saddle.ravel() * np.sign(np.median(saddle)) < _LEAST_SADDLE
    bad |= middle_excess(picture, uv, *flat) > _MOST_EXCESS
    bad |= np.linalg.norm(uv - rough, axis=1) > _FARTHEST_MOVE * spacing(grid)
    bad |= ~inside(uv, picture.values.shape) | ~np.isfinite(std)
    uv[bad], std[bad] = np.nan, np.nan
    return FoundPoints(uv, std, window.astype(float))
