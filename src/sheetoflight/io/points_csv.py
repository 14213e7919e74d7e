"""``points.csv``: the image points of markers, boards, spots and matches, one a row.

Header ``view,stage,marker,u,v``, further columns ``std`` (px), ``laser`` (a laser's name), ``face``
(a number) and ``x,y,z`` (mm) as wanted. Rows come in any order. A marker that was not seen has no
row, so a view without any seen marker is not part of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.board_points import BoardRows, board_rows
from sheetoflight.io.csv_table import Row, read_table, table_text
from sheetoflight.io.match_points import STAGE as MATCH
from sheetoflight.io.match_points import MatchRows, match_rows
from sheetoflight.io.quoting import file_name, shown
from sheetoflight.model.board import Board
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

COLUMNS = ("view", "stage", "marker", "u", "v")
OPTIONAL_COLUMNS = ("std", "laser", "face", "x", "y", "z")
STAGES = ("camera", "plane", "crossing")
BOARD = "board"
SPOT = "laser"
"""What column ``marker`` says of the spot where a sheet crosses the target."""

_FEWEST_MARKERS = 3


@dataclass
class _View:
    """What the rows of one view say: where it began, its laser, and each column's point."""

    place: str
    laser: int
    points: dict[int, tuple[float, float, float | None]] = field(default_factory=dict)


_Views = dict[str, _View]


def read_points(
    path: str | Path,
    target: CollinearTarget | None,
    lasers: Sequence[str] = Rig.lasers,
    board: Board | None = None,
) -> Observations:
    """Detections of the target's markers, of boards, and of the lasers' light on either.

    Column ``laser`` names the sheet that a view of stage plane lies in, or that a spot or a point
    of a line belongs to. It may be empty or absent where there is one laser; in other rows it says
    nothing. Columns ``x,y,z`` may say where a point is on its board: they must agree with
    ``[board]``; without one, ``x,y`` of a line's point are its place in the sheet of light. Column
    ``face`` numbers the face of a solid body that a line's point lies on.

    Parameters
    ----------
    path : str or Path
    target : CollinearTarget, optional
        Says how many markers a view may have; only the stages board and match may be there where
        absent.
    lasers : sequence of str
        Names of the rig's lasers.
    board : Board, optional
        Says which points stage board may have; where absent, only those of lines with places.

    Returns
    -------
    Observations
        Views in the order of their first rows; NaN for a marker or spot without a row. Views of
        stage crossing have the spots behind the markers, in the order of `lasers`.

    Raises
    ------
    InputError
        For anything that is wrong with the table, naming file and line: columns, numbers,
        stages, a marker or laser that the rig does not have, a point given twice, a view in two
        sheets, a view of stage crossing without a spot.
    FileError
        If the file cannot be read as text.
    """
    markers = 0 if target is None else len(target.markers_mm)
    stages: dict[str, _Views] = {stage: {} for stage in STAGES}
    boards, matches = BoardRows(board), MatchRows()
    for row in read_table(path, COLUMNS, OPTIONAL_COLUMNS):
        stage = _stage(row)
        if stage == MATCH:
            matches.add(row)
            continue
        if stage == BOARD:
            on_line = row.cells["marker"].strip() == SPOT
            boards.add(row, _laser(row, lasers, needed=on_line))
            continue
        if target is None:
            raise InputError(
                f"{row.place}: a point of stage {stage}, but rig.toml has no [target]",
                "describe the target there, by markers_mm, or correct the stage to board",
            )
        _add(row, stage, stages[stage], markers, lasers)
    for name, view in stages["crossing"].items():
        if max(view.points) < markers:
            raise InputError(
                f"{view.place}: view {shown(name)} of stage crossing has no spot",
                f"add a row with marker {SPOT}, or remove the view",
            )
    return Observations(
        camera=_target_views(stages["camera"], markers),
        plane=_target_views(stages["plane"], markers),
        crossing=_target_views(stages["crossing"], markers + len(lasers)),
        board=boards.views(),
        matches=matches.matches(),
    )


def write_points(
    path: str | Path,
    observations: Observations,
    lasers: Sequence[str] = Rig.lasers,
    board: Board | None = None,
) -> None:
    """Write ``points.csv``, whole or not at all; numbers come back exactly.

    Parameters
    ----------
    path : str or Path
    observations : Observations
    lasers : sequence of str
        Names of the rig's lasers, in the order in which the observations number them.
    board : Board, optional
        Where the points of stage board are, mm: written beside them.

    Raises
    ------
    InputError
        If no point was seen, a view has no name, a view of stage crossing no spot, or the
        observations do not go with so many lasers.
    FileError
        If the file cannot be written.
    """
    stages = observations.stages()
    rows = [row for stage, views in stages.items() for row in _rows(stage, views, lasers)]
    rows += board_rows(observations.board, board, lasers)
    rows += match_rows(observations.matches)
    present = {column for row in rows for column, value in row.items() if value != ""}
    if len(lasers) < 2:
        present.discard("laser")
    columns = [*COLUMNS, *(column for column in OPTIONAL_COLUMNS if column in present)]
    if not rows:
        raise InputError(
            f"there is no point to write to {file_name(path)}", "detect markers in a picture first"
        )
    write_whole(
        path, table_text(columns, ([row.get(column, "") for column in columns] for row in rows))
    )


def _stage(row: Row) -> str:
    stage = row.cells["stage"].strip()
    if stage not in (*STAGES, BOARD, MATCH):
        raise InputError(
            f"{row.place}: unknown stage {shown(stage)}",
            f"use {', '.join((*STAGES, BOARD))} or {MATCH}",
        )
    return stage


def _add(row: Row, stage: str, views: _Views, markers: int, lasers: Sequence[str]) -> None:
    """Put a row's point into its view."""
    spot = row.cells["marker"].strip() == SPOT
    if spot and stage != "crossing":
        raise InputError(
            f"{row.place}: a point of marker {SPOT} stands in stage {stage}",
            "correct the stage to crossing or board, or remove the row",
        )
    laser = _laser(row, lasers, needed=spot or stage == "plane")
    column = markers + laser if spot else _marker(row, markers)
    name = row.text("view")
    view = views.setdefault(name, _View(row.place, laser if stage == "plane" else 0))
    if stage == "plane" and laser != view.laser:
        raise InputError(
            f"{row.place}: view {shown(name)} of stage plane is of laser {shown(lasers[laser])}, "
            f"and before of laser {shown(lasers[view.laser])}",
            "a target lies in one sheet: give the views of each laser names of their own",
        )
    if column in view.points:
        point = f"the spot of laser {shown(lasers[laser])}" if spot else f"marker {column}"
        raise InputError(
            f"{row.place}: {point} of view {shown(name)} in stage {stage} is given twice",
            "give every point once, and every view of a stage a name of its own",
        )
    view.points[column] = (row.number("u"), row.number("v"), row.optional_positive("std"))
    for coordinate in ("x", "y", "z"):
        row.optional_number(coordinate)


def _laser(row: Row, lasers: Sequence[str], needed: bool) -> int:
    """Number of the laser that a row names; the first where it names none and need not."""
    cell = row.cells.get("laser", "")
    name = cell if cell in lasers else cell.strip()
    if name in lasers:
        return lasers.index(name)
    known = " or ".join(shown(laser) for laser in lasers)
    if name:
        raise InputError(
            f"{row.place}: unknown laser {shown(name)}",
            f"use {known}, or name it in a [[laser]] of rig.toml",
        )
    if needed and len(lasers) > 1:
        raise InputError(
            f"{row.place}: the rig has {len(lasers)} lasers, and the row names none",
            f"write {known} into column 'laser'",
        )
    return 0


def _marker(row: Row, count: int) -> int:
    marker = row.whole("marker")
    if marker is None or marker >= count:
        raise InputError(
            f"{row.place}: marker is {shown(row.cells['marker'])}, "
            f"expected a whole number from 0 to {count - 1}",
            "correct it, or list all markers of the target in rig.toml",
        )
    return marker


def _target_views(views: _Views, columns: int) -> TargetViews:
    uv = np.full((len(views), columns, 2), np.nan)
    std = np.full((len(views), columns), np.nan)
    for index, view in enumerate(views.values()):
        for column, (u, v, spread) in view.points.items():
            uv[index, column] = u, v
            std[index, column] = np.nan if spread is None else spread
    return TargetViews(
        tuple(views),
        uv,
        std if np.isfinite(std).any() else None,
        np.array([view.laser for view in views.values()], dtype=int),
    )


def _rows(
    stage: str, views: TargetViews, lasers: Sequence[str]
) -> list[dict[str, str | int | float]]:
    """A row by column name for every point that was seen."""
    _check_writable(stage, views, lasers)
    markers = views.uv.shape[1] - (len(lasers) if stage == "crossing" else 0)
    std = np.full(views.seen.shape, np.nan) if views.std is None else views.std
    rows: list[dict[str, str | int | float]] = []
    for view, column in np.argwhere(views.seen):
        spot, spread = column >= markers, float(std[view, column])
        sheet = int(column - markers if spot else views.lasers[view])
        rows.append(
            {
                "view": views.names[view],
                "stage": stage,
                "marker": SPOT if spot else int(column),
                "u": float(views.uv[view, column, 0]),
                "v": float(views.uv[view, column, 1]),
                "std": spread if np.isfinite(spread) else "",
                "laser": lasers[sheet] if spot or stage == "plane" else "",
            }
        )
    return rows


def _check_writable(stage: str, views: TargetViews, lasers: Sequence[str]) -> None:
    """Refuse what could not be read again."""
    for name in views.names:
        if not name or "\0" in name:
            raise InputError(f"a view of stage {stage} is called {shown(name)}", "give it a name")
    if stage == "plane" and (views.lasers >= len(lasers)).any():
        raise InputError(
            f"a view of stage plane lies in sheet {views.lasers.max()}, counted from 0, and there "
            f"are {len(lasers)} lasers",
            "name every laser of the rig",
        )
    if stage != "crossing":
        return
    spots = views.seen[:, -len(lasers) :]
    if views.uv.shape[1] < _FEWEST_MARKERS + len(lasers):
        raise InputError(
            f"views of stage crossing have {views.uv.shape[1]} points",
            f"give {_FEWEST_MARKERS} markers or more, then a spot for each of {len(lasers)} lasers",
        )
    lost = views.seen.any(axis=1) & ~spots.any(axis=1)
    if lost.any():
        raise InputError(
            f"view {shown(views.names[int(np.argmax(lost))])} of stage crossing has no spot",
            "find the laser's spot on the target, or leave the view out",
        )
