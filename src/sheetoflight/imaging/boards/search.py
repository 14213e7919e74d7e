"""The search for a board in one picture, step by step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.charuco import find_charuco
from sheetoflight.imaging.boards.chessboard import find_chessboard
from sheetoflight.imaging.boards.circles import find_circles
from sheetoflight.imaging.boards.homography import on_grid, plane_to_picture
from sheetoflight.imaging.boards.laser_touch import touched
from sheetoflight.imaging.boards.sighting import BoardSearch, BoardSighting, FoundPoints
from sheetoflight.imaging.markers.grey import GreyPicture, grey_picture
from sheetoflight.model.board import BoardKind, PlanarBoard

_FINDERS: dict[BoardKind, Callable[[GreyPicture, PlanarBoard], FoundPoints | str]] = {
    "chessboard": find_chessboard,
    "circles": find_circles,
    "charuco": find_charuco,
}
_FEWEST = 8
"""Points; a plane's view leaves its homography eight numbers, that is four points."""

_SYSTEMATIC_PX = 0.02
"""What is left of a point's error in a picture without noise; pixels are sums over squares."""

_DISTURBED = 5.0
"""How much worse a corner is that the laser line shines on: measured on photographs of a line
across a board, by what a smooth map through the other corners says."""


def find_board(
    picture: NDArray[Any], board: PlanarBoard, picture_on: NDArray[Any] | None = None
) -> BoardSearch:
    """Find the points of a printed board, to a fraction of a pixel.

    In a chessboard and a plain grid of circles every turn that looks the same is the same to a
    calibration; the numbering always runs so that x × y points away from the camera. Mirrored
    pictures show in charuco boards, and in staggered grids of an even number of rows, only.

    Parameters
    ----------
    picture : (H, W) or (H, W, 3) array
        uint8, uint16 or floating point; colour in OpenCV's order BGR. Of a pair the one with the
        laser off; otherwise the only one, the laser line across the board or not.
    board : PlanarBoard
    picture_on : array of the same shape, optional
        The same view with the laser on. Where it is given, `picture` holds no laser line;
        otherwise points that the line shines on are taken as not seen.

    Returns
    -------
    BoardSearch
        With the sighting, or None and the reason why there is none, and what to do.

    Raises
    ------
    InputError
        If the image is no picture, or the pair's two are not of the same size.
    """
    grey = grey_picture(picture)
    if picture_on is not None and np.shape(picture_on)[:2] != np.shape(picture)[:2]:
        raise InputError(
            f"the pictures with the laser off and on have shapes {np.shape(picture)} and "
            f"{np.shape(picture_on)}",
            "give two of the same camera",
        )
    found = _FINDERS[board.kind](grey, board)
    if isinstance(found, str):
        return BoardSearch(None, found)
    matrix = plane_to_picture(board, found.uv)
    if matrix is None or _seen(found.uv) < _fewest(board):
        return BoardSearch(None, _too_few(found.uv, board))
    std = np.hypot(found.std, _SYSTEMATIC_PX)
    lit = np.zeros(len(std), dtype=bool)
    if picture_on is None:
        lit = touched(np.asarray(picture), on_grid(matrix, board), found.uv, found.reach)
    return _outcome(found.uv, std, lit, board)


def _outcome(uv: Array, std: Array, lit: NDArray[np.bool_], board: PlanarBoard) -> BoardSearch:
    dark = np.where(lit[:, None], np.nan, uv)
    if not lit.any():
        return _sighting(uv, std, f"{_seen(uv)} of {len(uv)} points found")
    if _seen(dark) >= _fewest(board) and _spread(dark, board):
        return _sighting(
            dark,
            np.where(lit, np.nan, std),
            f"{_seen(dark)} of {len(uv)} points found, {lit.sum()} more lie under the laser line",
        )
    return _sighting(
        uv,
        np.where(lit, _DISTURBED * std, std),
        f"{_seen(uv)} of {len(uv)} points found; {lit.sum()} under the laser line are kept as less "
        "certain, as there are too few others – a picture with the laser off would serve better",
    )


def _sighting(uv: Array, std: Array, reason: str) -> BoardSearch:
    return BoardSearch(BoardSighting(uv, std), reason)


def _seen(uv: Array) -> int:
    return int(np.isfinite(uv).all(axis=1).sum())


def _fewest(board: PlanarBoard) -> int:
    return min(_FEWEST, board.columns * board.rows)


def _spread(uv: Array, board: PlanarBoard) -> bool:
    """Whether the points seen reach over half of the board's width and height."""
    seen = np.isfinite(uv).all(axis=1)
    extent = np.ptp(board.points[seen, :2], axis=0) / np.ptp(board.points[:, :2], axis=0)
    return bool((extent >= 0.5).all())


def _too_few(uv: Array, board: PlanarBoard) -> str:
    return (
        f"only {_seen(uv)} of {len(uv)} points of the board are clear enough, or all of them lie "
        f"on one line; at least {_fewest(board)} are needed – light the board evenly, and keep "
        "the laser less bright"
    )
