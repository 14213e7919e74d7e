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
from sheetoflight.imaging.boards.homography import plane_to_picture
from sheetoflight.imaging.boards.sighting import BoardSearch, BoardSighting, FoundPoints
from sheetoflight.imaging.boards.symmetry import asymmetry, disturbed, disturbed_std
from sheetoflight.imaging.markers.grey import GreyPicture, grey_picture
from sheetoflight.model.board import BoardKind, PlanarBoard

_FINDERS: dict[BoardKind, Callable[[GreyPicture, PlanarBoard], FoundPoints | str]] = {
    "chessboard": find_chessboard,
    "circles": find_circles,
    "charuco": find_charuco,
}
_FEWEST = 8
"""Points; a plane's view leaves its homography eight numbers, that is four points."""


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
        laser off; otherwise the only one, the laser line across the board or not. Points that
        the line, a reflection or a finger disturbs are taken as not seen.
    board : PlanarBoard
    picture_on : array of the same shape, optional
        The same view with the laser on, looked into where the other does not show the board.

    Returns
    -------
    BoardSearch
        With the sighting, or None and the reason why there is none, and what to do.

    Raises
    ------
    InputError
        If the image is no picture, or the pair's two are not of the same size.
    """
    if picture_on is not None and np.shape(picture_on)[:2] != np.shape(picture)[:2]:
        raise InputError(
            f"the pictures with the laser off and on have shapes {np.shape(picture)} and "
            f"{np.shape(picture_on)}",
            "give two of the same camera",
        )
    search = _searched(grey_picture(picture), board)
    if search.sighting is None and picture_on is not None:
        lit = _searched(grey_picture(picture_on), board)
        return search if lit.sighting is None else lit
    return search


def _searched(picture: GreyPicture, board: PlanarBoard) -> BoardSearch:
    found = _FINDERS[board.kind](picture, board)
    if isinstance(found, str):
        return BoardSearch(None, found)
    if plane_to_picture(board, found.uv) is None or _seen(found.uv) < _fewest(board):
        return BoardSearch(None, _too_few(found.uv, board))
    return _outcome(picture, found, board)


def _outcome(picture: GreyPicture, found: FoundPoints, board: PlanarBoard) -> BoardSearch:
    uv, std = found.uv, found.std
    share = asymmetry(picture.values, uv, np.ceil(found.reach).astype(np.int64))
    bad = disturbed(share)
    if not bad.any():
        return _sighting(uv, std, f"{_seen(uv)} of {len(uv)} points found")
    clear = np.where(bad[:, None], np.nan, uv)
    if _seen(clear) >= _fewest(board) and _spread(clear, board):
        return _sighting(
            clear,
            np.where(bad, np.nan, std),
            f"{_seen(clear)} of {len(uv)} points found; {bad.sum()} more are left out: a line of "
            "light, a reflection or dirt lies beside them",
        )
    return _sighting(
        uv,
        np.where(bad, disturbed_std(std, share, found.reach), std),
        f"{_seen(uv)} of {len(uv)} points found; {bad.sum()} beside a line of light, a reflection "
        "or dirt are kept as less certain, as there are too few others – a picture with the laser "
        "off would serve better",
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
