"""What is in a picture where the board that was asked for is not."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.grid import one_more
from sheetoflight.imaging.boards.levels import at_working_size, brightened, eight_bit
from sheetoflight.imaging.boards.second_board import where
from sheetoflight.imaging.boards.sharpness import too_blurred
from sheetoflight.imaging.markers.grey import Picture
from sheetoflight.model.board import PlanarBoard

_FEWEST = 3
_FULL, _MUCH = 254.5, 0.05
_ENOUGH = 20
"""Corners; smaller grids are seen in any texture."""


def why_not_found(values: Picture, board: PlanarBoard) -> str:
    """Why a chessboard of the stated size was not found, and what to do."""
    asked = f"{board.columns} × {board.rows}"
    grid = _any_grid(values)
    if grid is None or grid.size // 2 < min(_ENOUGH, board.columns * board.rows // 3):
        return f"no chessboard of {asked} inner corners found – {_hint(values)}"
    blurred = too_blurred(values, grid)
    if blurred is not None:
        return blurred
    rows, columns = grid.shape[:2]
    if {rows, columns} == {board.columns, board.rows}:
        return (
            f"the board at {where(grid)} shows too few clear corners – light it evenly, without "
            "glare, or make the laser less bright"
        )
    found = f"{max(rows, columns)} × {min(rows, columns)}"
    if board.columns < board.rows:
        found = f"{min(rows, columns)} × {max(rows, columns)}"
    if _runs_out(grid, values.shape):
        return (
            f"only {found} of {asked} inner corners are in the picture, about {where(grid)}: the "
            "board runs out of it – bring the whole board into view, or use a charuco board, of "
            "which a part is enough"
        )
    correct = "correct columns and rows (inner corners, not squares)"
    uncover = "uncover the board: glare, the laser line or a hand may hide the rest"
    least, most = sorted((board.columns, board.rows))
    part = min(rows, columns) <= least and max(rows, columns) <= most
    remedy = f"{uncover}; or {correct}" if part else f"{correct}, or {uncover}"
    return f"found a board of {found} corners at {where(grid)}, [board] says {asked} – {remedy}"


def _hint(values: Picture) -> str:
    full = float(np.mean(values >= _FULL))
    if full > _MUCH:
        return (
            f"{full:.0%} of the picture is full white: make the laser or the lamp less bright, or "
            "take a picture with the laser off"
        )
    return "bring the whole board into view, evenly lit and sharp, with a light border around it"


def inside(uv: Array, shape: tuple[int, ...]) -> np.ndarray:
    """Which image points ``(..., 2)`` lie in a picture of a shape (height, width)."""
    return np.all((uv >= 0.0) & (uv <= np.array(shape[1::-1]) - 1.0), axis=-1)


def _any_grid(values: Picture) -> Array | None:
    """The largest grid of corners of any size, ``(rows, columns, 2)`` px."""
    work, size = at_working_size(values)
    half = np.asarray(cv2.pyrDown(work), dtype=np.float32)
    grids = []
    for form, width in ((work, size), (half, 2.0 * size)):
        for look in (eight_bit(form), brightened(form)):
            flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners, meta = cv2.findChessboardCornersSBWithMeta(
                look, (_FEWEST, _FEWEST), flags
            )
            if found:
                grids.append(width * np.asarray(corners, dtype=float).reshape(*meta.shape, 2))
    return max(grids, key=lambda g: g.size, default=None)


def _runs_out(grid: Array, shape: tuple[int, ...]) -> bool:
    """Whether a further row or column would lie, in part, outside the picture."""
    return any(not inside(line, shape).all() for line in one_more(grid))
