"""Corners as other tools keep them, put onto a board of columns and rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.exchange.bouguet_corners import bouguet_image_size, read_bouguet_corners
from sheetoflight.io.exchange.mat_reading import LIMIT_BYTES, MAGIC
from sheetoflight.io.exchange.values import named
from sheetoflight.io.points_csv import write_points
from sheetoflight.io.quoting import file_name
from sheetoflight.io.reading import read_bytes
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.observations import Observations

_EVEN = 1e-4
"""Greatest distance of a point from its place in an even grid, in pitches."""

_MOST = 1000
"""Columns, or rows."""


@dataclass(frozen=True)
class Corners:
    """A board and where its corners were seen.

    Parameters
    ----------
    board : PlanarBoard
    views : BoardViews
        Points in the board's own order; NaN where one was not seen.
    image_size : (int, int) or None
        Width and height of the pictures in px; None where the file does not say it.
    """

    board: PlanarBoard
    views: BoardViews
    image_size: tuple[int, int] | None


def read_corners(path: str | Path) -> Corners:
    """The corners of a flat, even board in ``calib_data.mat`` or ``Calib_Results.mat``.

    Raises
    ------
    FileError
        If the file cannot be read, is damaged, or a MATLAB file of another version.
    InputError
        If it is no MATLAB file, holds no corners, or their places on the board are no even grid.
    """
    if not read_bytes(path, LIMIT_BYTES).startswith(MAGIC):
        raise InputError(
            f"{file_name(path)} is no MATLAB file",
            "corners are taken from calib_data.mat, or Calib_Results.mat, of Bouguet's toolbox",
        )
    points, views = read_bouguet_corners(path)
    with named(path):
        board, places = even_board(points)
    uv = np.full((len(views), board.columns * board.rows, 2), np.nan)
    uv[:, places] = views.uv
    return Corners(board, BoardViews(views.names, uv), bouguet_image_size(path))


def write_corners(path: str | Path, corners: Corners) -> None:
    """Write corners as stage board of a ``points.csv``, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_points(path, Observations(board=corners.views), board=corners.board)


def even_board(points: Array) -> tuple[PlanarBoard, np.ndarray]:
    """The chessboard that points belong to, and the number of each in it.

    Its first point is where the least x and the least y meet, wherever the other tool counts from.

    Parameters
    ----------
    points : (M, 3) array
        In a frame of the board with z = 0, mm; some of the board's points may be missing.

    Raises
    ------
    InputError
        If the points are no even grid in x and y.
    """
    if float(np.ptp(points[:, 2])) > _EVEN * float(np.ptp(points[:, :2])):
        raise InputError(
            "its board points do not lie in one plane of constant z",
            "give the corners of a flat board, z = 0",
        )
    (column, x), (row, y) = (_places(points[:, axis], name) for axis, name in enumerate("xy"))
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    return PlanarBoard("chessboard", columns, rows, (x, y)), row * columns + column


def _places(values: Array, axis: str) -> tuple[np.ndarray, float]:
    """Number of each value ``(M,)`` in an even row of them, and their distance."""
    offsets = values - values.min()
    distinct = np.unique(offsets)
    size = float(distinct[-1])
    steps = np.diff(distinct)
    steps = steps[steps > _EVEN * size / _MOST]
    pitch = size / max(round(size / float(np.median(steps))), 1) if steps.size else 0.0
    if not pitch:
        raise InputError(
            f"all its board points have the same {axis}",
            "give corners that are not on one line",
        )
    numbers = np.rint(offsets / pitch)
    if numbers.max() >= _MOST or np.abs(offsets / pitch - numbers).max() > _EVEN:
        raise InputError(
            f"its board points are not evenly spaced along {axis}",
            "give the corners of one board with even columns and rows, taken with the same dX and "
            "dY in all pictures; read_bouguet_corners gives others in Python",
        )
    return numbers.astype(np.int64), pitch
