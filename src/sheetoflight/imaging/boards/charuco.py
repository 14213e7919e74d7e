"""Finding the corners of a charuco board: a chessboard with a coded marker in its light squares."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.corners import corner_std, refined, windows
from sheetoflight.imaging.boards.grid import is_mirrored, room, spacing, steps
from sheetoflight.imaging.boards.homography import on_grid, plane_to_picture
from sheetoflight.imaging.boards.levels import EightBit, shown
from sheetoflight.imaging.boards.other_size import inside
from sheetoflight.imaging.boards.saddles import saddles
from sheetoflight.imaging.boards.sighting import FoundPoints
from sheetoflight.imaging.markers.grey import GreyPicture
from sheetoflight.model.board import PlanarBoard

_FEWEST = 6
_LEAST_SADDLE = 0.6
_FARTHEST_MOVE = 0.2


def find_charuco(picture: GreyPicture, board: PlanarBoard) -> FoundPoints | str:
    """The corners of a charuco board of which a marker nearby could be read, or why there are
    none.

    Parameters
    ----------
    picture : GreyPicture
    board : PlanarBoard
        Of kind ``charuco``.
    """
    dictionary = _dictionary(board)
    if isinstance(dictionary, str):
        return dictionary
    best = np.full((board.columns * board.rows, 2), np.nan)
    for form, size in shown(picture.values):
        corners = _decoded(form, board, dictionary)
        if _count(corners) > _count(best):
            best = size * corners
        if _count(best) == len(best):
            break
    matrix = plane_to_picture(board, best) if _count(best) >= _FEWEST else None
    if matrix is None:
        return _why_not(picture, board, dictionary, best)
    grid = on_grid(matrix, board)
    if is_mirrored(grid):
        return _MIRRORED
    return _measured(picture, board, best, grid)


_MIRRORED = (
    "the picture is mirrored: the charuco board's markers can be read only when it is flipped – "
    "switch the flip off in the camera's software"
)


def _dictionary(board: PlanarBoard) -> cv2.aruco.Dictionary | str:
    number = getattr(cv2.aruco, board.dictionary, None)
    if not board.dictionary.startswith("DICT_") or not isinstance(number, int):
        return (
            f"the dictionary {board.dictionary!r} is not known – give [board] dictionary by "
            "OpenCV's name, such as DICT_4X4_50"
        )
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    needed = (board.columns + 1) * (board.rows + 1) // 2
    held = len(dictionary.bytesList)
    if held < needed:
        return (
            f"a charuco board of {board.columns} × {board.rows} corners has {needed} markers, "
            f"{board.dictionary} only {held} – correct dictionary, columns or rows in [board]"
        )
    return dictionary


def _decoded(form: EightBit, board: PlanarBoard, dictionary: cv2.aruco.Dictionary) -> Array:
    """Corners ``(M, 2)`` of the picture's form, NaN where not seen.

    Boards made by OpenCV before 4.6 begin with a light square if they have an even number of
    rows; what decodes tells which one it is.
    """
    corners = _decoded_as(form, board, dictionary, legacy=False)
    if _count(corners) < _FEWEST and board.rows % 2:
        older = _decoded_as(form, board, dictionary, legacy=True)
        corners = max(corners, older, key=_count)
    return corners


def _decoded_as(
    form: EightBit, board: PlanarBoard, dictionary: cv2.aruco.Dictionary, legacy: bool
) -> Array:
    side = min(board.pitch_mm)
    squares = (board.columns + 1, board.rows + 1)
    pattern = cv2.aruco.CharucoBoard(squares, side, board.marker_side, dictionary)
    pattern.setLegacyPattern(legacy)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(form)
    uv = np.full((board.columns * board.rows, 2), np.nan)
    if ids is not None and len(ids):
        uv[np.ravel(ids).astype(np.int64)] = np.reshape(corners, (-1, 2))
    return uv


def _count(uv: Array) -> int:
    return int(np.isfinite(uv).all(axis=1).sum())


def _why_not(
    picture: GreyPicture, board: PlanarBoard, dictionary: cv2.aruco.Dictionary, best: Array
) -> str:
    for form, _ in shown(picture.values):
        flipped = np.ascontiguousarray(form[:, ::-1])
        if _count(_decoded(flipped, board, dictionary)) >= _FEWEST:
            return _MIRRORED
    if _count(best):
        return (
            f"only {_count(best)} corners of the charuco board could be read, or all on one line "
            "– bring more of it into view, nearer and sharper"
        )
    return _no_board(picture, board, dictionary)


def _no_board(picture: GreyPicture, board: PlanarBoard, dictionary: cv2.aruco.Dictionary) -> str:
    most = 0
    for form, _ in shown(picture.values):
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(form)
        most = max(most, 0 if ids is None else len(ids))
    if most:
        return (
            f"{most} markers of {board.dictionary} can be read, but they do not lie as on a board "
            f"of {board.columns} × {board.rows} corners – correct columns and rows in [board] "
            "(inner corners, not squares)"
        )
    return (
        f"no marker of {board.dictionary} can be read – bring the charuco board into view, sharp "
        "and evenly lit, and check dictionary in [board]"
    )


def _measured(picture: GreyPicture, board: PlanarBoard, rough: Array, grid: Array) -> FoundPoints:
    free = _free_of_markers(board) * room(grid).ravel()
    window = windows(free)
    seen = inside(rough, picture.values.shape)
    uv, std = np.full_like(rough, np.nan), np.full(len(rough), np.nan)
    uv[seen] = refined(picture, rough[seen], window[seen])
    std[seen] = corner_std(picture, uv[seen], window[seen])
    places = np.where(seen[:, None], uv, grid.reshape(-1, 2))
    flat = [step.reshape(-1, 2) for step in steps(grid)]
    saddle = np.abs(saddles(picture, places, *flat))
    moved = np.linalg.norm(places - np.where(seen[:, None], rough, places), axis=1)
    bad = ~seen | ~np.isfinite(std) | (moved > _FARTHEST_MOVE * spacing(grid))
    bad |= (saddle < _LEAST_SADDLE / 2) | ~inside(places, picture.values.shape)
    uv[bad], std[bad] = np.nan, np.nan
    return FoundPoints(uv, std, window.astype(float))


def _free_of_markers(board: PlanarBoard) -> float:
    """Share of a corner's room up to the nearest marker."""
    side = min(board.pitch_mm)
    return (side - board.marker_side) / (2.0 * side)
