"""Rows of ``points.csv`` in stage board: a board's points, and points of lines of light on it.

Without a board, points of the line alone, each with its place in the sheet (method self-generated).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.csv_table import Row
from sheetoflight.io.quoting import shown
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews, LinePixels

LINE = "laser"
"""What column ``marker`` says of a point of a line."""

_PLACE_TOLERANCE = 1e-6
"""Greatest difference, as a part of the board's size, between a point's place in the table and in
``[board]`` that is rounding."""

_COORDINATES = ("x", "y", "z")

_NOWHERE = (float("nan"), float("nan"))


@dataclass
class BoardRows:
    """What the rows of stage board say, gathered row by row.

    Parameters
    ----------
    board : Board or None
        What ``[board]`` describes.
    names : dict from view to its number
    """

    board: Board | None
    names: dict[str, int] = field(default_factory=dict)
    points: dict[tuple[int, int], tuple[float, float, float | None]] = field(default_factory=dict)
    line: list[tuple[float, ...]] = field(default_factory=list)

    def add(self, row: Row, laser: int) -> None:
        """Take in a row.

        Parameters
        ----------
        row : Row
        laser : int
            Number of the laser that it names.

        Raises
        ------
        InputError
            If the point is not on the board, is given twice, or lies elsewhere; if the rig has no
            board, and the row is none of the line, or does not say where in the sheet it is.
        """
        on_line = row.cells["marker"].strip() == LINE
        place = _place_in_sheet(row) if self.board is None and on_line else _NOWHERE
        if self.board is None and place is _NOWHERE:
            raise InputError(
                f"{row.place}: a point of stage board, but rig.toml has no [board]",
                "describe the board there: kind, columns, rows and pitch_mm; only points of the "
                "line whose places x, y in the sheet are given need none",
            )
        view = self.names.setdefault(row.text("view"), len(self.names))
        u, v, std = row.number("u"), row.number("v"), row.optional_positive("std")
        if on_line:
            spread = float("nan") if std is None else std
            face = 0 if self.board is None else self._face(row, self.board)
            self.line.append((u, v, spread, view, laser, face, *place))
            return
        assert self.board is not None  # refused above
        point = self._point(row, self.board)
        if (view, point) in self.points:
            raise InputError(
                f"{row.place}: point {point} of view {shown(row.text('view'))} in stage board is "
                "given twice",
                "give every point once, and every view of a stage a name of its own",
            )
        self.points[view, point] = (u, v, std)

    def views(self) -> BoardViews:
        """The views, in the order of their first rows."""
        if not self.names:
            return BoardViews()
        count = 0 if self.board is None else len(self.board.points)
        uv, std = (
            np.full((len(self.names), count, 2), np.nan),
            np.full((len(self.names), count), np.nan),
        )
        for (view, point), (u, v, spread) in self.points.items():
            uv[view, point] = u, v
            std[view, point] = np.nan if spread is None else spread
        table = np.array(self.line, dtype=float).reshape(-1, 8)
        line = LinePixels(table[:, :2], *table[:, 2:6].T, place=table[:, 6:])
        return BoardViews(tuple(self.names), uv, std, line)

    @staticmethod
    def _face(row: Row, board: Board) -> int:
        text = row.cells.get("face", "").strip()
        face = row.whole("face") if text else 0
        if face is None or face >= len(board.faces) or (not text and len(board.faces) > 1):
            raise InputError(
                f"{row.place}: face is {shown(text)}, expected a whole number from 0 to "
                f"{len(board.faces) - 1}",
                "say in column 'face' on which of the body's faces the line is seen",
            )
        return face

    @staticmethod
    def _point(row: Row, board: Board) -> int:
        count = len(board.points)
        point = row.whole("marker")
        if point is None or point >= count:
            raise InputError(
                f"{row.place}: marker is {shown(row.cells['marker'])}, expected a whole number "
                f"from 0 to {count - 1}, or {LINE}",
                "number the board's points row by row, as [board] in rig.toml has them",
            )
        place = [row.optional_number(coordinate) for coordinate in _COORDINATES]
        given = np.array([np.nan if value is None else value for value in place])
        size = float(np.ptp(board.points, axis=0).max())
        if np.nan_to_num(np.abs(given - board.points[point])).max() > _PLACE_TOLERANCE * size:
            raise InputError(
                f"{row.place}: point {point} is said to be at {_listed(given)} mm, and [board] in "
                f"rig.toml puts it at {_listed(board.points[point])}",
                "correct one of the two",
            )
        return point


def _place_in_sheet(row: Row) -> tuple[float, float]:
    """Where in the sheet a row says its point is, mm; `_NOWHERE` where it does not say.

    Raises
    ------
    InputError
        If it gives one coordinate alone, or one off the sheet.
    """
    x, y, z = (row.optional_number(coordinate) for coordinate in _COORDINATES)
    if x is None and y is None:
        return _NOWHERE
    if x is None or y is None or z:
        raise InputError(
            f"{row.place}: a point of the line has the place "
            f"({', '.join('–' if value is None else f'{value:.6g}' for value in (x, y, z))}) mm",
            "give its x and y in the sheet of light, and no z: x along the line, y by the stage",
        )
    return x, y


def _listed(values: Array) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"


def board_rows(
    views: BoardViews, board: Board | None, lasers: Sequence[str]
) -> list[dict[str, str | int | float]]:
    """A row by column name for every point that was seen, then for those of the lines."""
    rows: list[dict[str, str | int | float]] = []
    for view, point in np.argwhere(views.seen).tolist():
        row = _row(views.names[view], point, views.uv[view][point], float(views.stds[view][point]))
        if board is not None:
            row["x"], row["y"], row["z"] = board.points[point].tolist()
        rows.append(row)
    line = views.line
    faces = board is not None and len(board.faces) > 1
    for k in np.argsort(line.view, kind="stable").tolist():
        row = _row(views.names[int(line.view[k])], LINE, line.uv[k], float(line.std[k]))
        row["laser"] = lasers[int(line.laser[k])]
        if faces:
            row["face"] = int(line.face[k])
        if np.isfinite(line.places[k]).all():
            row["x"], row["y"] = line.places[k].tolist()
        rows.append(row)
    return rows


def _row(view: str, marker: str | int, uv: Array, std: float) -> dict[str, str | int | float]:
    row: dict[str, str | int | float] = {"view": view, "stage": "board", "marker": marker}
    row["u"], row["v"] = uv.tolist()
    if np.isfinite(std):
        row["std"] = std
    return row
