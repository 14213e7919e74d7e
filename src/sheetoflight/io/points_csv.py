"""``points.csv``: the image points of markers, one a row.

Header ``view,stage,marker,u,v``, further columns ``std`` (px) and ``x,y,z`` (mm) as wanted. Rows
come in any order. A marker that was not seen has no row, so a view without any seen marker is
not part of the file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.csv_table import Row, read_table, table_text
from sheetoflight.io.quoting import file_name, shown
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.target import CollinearTarget

COLUMNS = ("view", "stage", "marker", "u", "v")
OPTIONAL_COLUMNS = ("std", "x", "y", "z")
STAGES = ("camera", "plane")
STAGES_NOT_ADJUSTED = ("crossing", "board")

_Points = dict[str, dict[int, tuple[float, float, float | None]]]


def read_points(path: str | Path, target: CollinearTarget) -> Observations:
    """Detections of the target's markers.

    Columns ``x,y,z`` belong to points on a board: they must be numbers, and are not used here.

    Parameters
    ----------
    path : str or Path
    target : CollinearTarget
        Says how many markers a view may have.

    Returns
    -------
    Observations
        Views in the order of their first rows; NaN for a marker without a row.

    Raises
    ------
    InputError
        For anything that is wrong with the table, naming file and line: columns, numbers,
        stages, a marker that the target does not have, a point given twice.
    FileError
        If the file cannot be read as text.
    """
    stages: dict[str, _Points] = {stage: {} for stage in STAGES}
    for row in read_table(path, COLUMNS, OPTIONAL_COLUMNS):
        stage, marker = _stage(row), _marker(row, len(target.markers_mm))
        view = row.text("view")
        points = stages[stage].setdefault(view, {})
        if marker in points:
            raise InputError(
                f"{row.place}: marker {marker} of view {shown(view)} in stage {stage} "
                "is given twice",
                "give every point once, and every view of a stage a name of its own",
            )
        points[marker] = (row.number("u"), row.number("v"), row.optional_positive("std"))
        for column in ("x", "y", "z"):
            row.optional_number(column)
    count = len(target.markers_mm)
    return Observations(
        camera=_views(stages["camera"], count), plane=_views(stages["plane"], count)
    )


def write_points(path: str | Path, observations: Observations) -> None:
    """Write ``points.csv``, whole or not at all; numbers come back exactly.

    Raises
    ------
    InputError
        If no point was seen, or a view has no name.
    FileError
        If the file cannot be written.
    """
    with_std = any(
        views.std is not None and np.isfinite(views.std[views.seen]).any()
        for views in observations.stages().values()
    )
    rows = [
        row
        for stage, views in observations.stages().items()
        for row in _rows(stage, views, with_std)
    ]
    if not rows:
        raise InputError(
            f"there is no point to write to {file_name(path)}", "detect markers in a picture first"
        )
    write_whole(path, table_text(COLUMNS + (("std",) if with_std else ()), rows))


def _stage(row: Row) -> str:
    stage = row.cells["stage"].strip()
    if stage in STAGES_NOT_ADJUSTED:
        raise InputError(
            f"{row.place}: points of stage {stage} are not adjusted by this version",
            f"remove the rows of stage {stage}",
        )
    if stage not in STAGES:
        raise InputError(f"{row.place}: unknown stage {shown(stage)}", f"use {' or '.join(STAGES)}")
    return stage


def _marker(row: Row, count: int) -> int:
    marker = row.whole("marker")
    if row.cells["marker"].strip() == "laser":
        raise InputError(
            f"{row.place}: points on the laser line are not adjusted by this version",
            "remove the rows of marker laser",
        )
    if marker is None or marker >= count:
        raise InputError(
            f"{row.place}: marker is {shown(row.cells['marker'])}, "
            f"expected a whole number from 0 to {count - 1}",
            "correct it, or list all markers of the target in rig.toml",
        )
    return marker


def _views(points: _Points, count: int) -> TargetViews:
    uv = np.full((len(points), count, 2), np.nan)
    std = np.full((len(points), count), np.nan)
    for index, markers in enumerate(points.values()):
        for marker, (u, v, spread) in markers.items():
            uv[index, marker] = u, v
            std[index, marker] = np.nan if spread is None else spread
    return TargetViews(tuple(points), uv, std if np.isfinite(std).any() else None)


def _rows(stage: str, views: TargetViews, with_std: bool) -> list[list[str | int | float]]:
    rows: list[list[str | int | float]] = []
    for view, marker in np.argwhere(views.seen):
        name = views.names[view]
        if not name or "\0" in name:
            raise InputError(f"a view of stage {stage} is called {shown(name)}", "give it a name")
        u, v = views.uv[view, marker]
        row: list[str | int | float] = [name, stage, int(marker), float(u), float(v)]
        if with_std:
            spread = np.nan if views.std is None else float(views.std[view, marker])
            row.append(spread if np.isfinite(spread) else "")
        rows.append(row)
    return rows
