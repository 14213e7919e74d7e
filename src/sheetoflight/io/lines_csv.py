"""``lines.csv``: the straight line through each piece of the laser line in space."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sheetoflight.io.atomic import write_whole
from sheetoflight.io.csv_table import table_text
from sheetoflight.measurement.straightness import SpaceLine

LINE_COLUMNS = (
    *("image", "line", "points"),
    *("length_mm", "rms_mm", "straightness_mm", "noise_straightness_mm"),
    *("x", "y", "z", "dx", "dy", "dz"),
)

LineRow = tuple[str | int | float, ...]
"""A value for each of `LINE_COLUMNS`."""


def line_row(line: SpaceLine) -> LineRow:
    """A line as ``lines.csv`` holds it: a point of it ``x,y,z`` in mm, and its unit direction
    ``dx,dy,dz``, in the frame of the points."""
    lengths = (line.length_mm, line.rms_mm, line.straightness_mm, line.noise_straightness_mm)
    place = (*line.point.tolist(), *line.direction.tolist())
    return line.picture, line.line, line.points, *map(float, lengths), *place


def lines_csv(lines: Iterable[SpaceLine]) -> str:
    """The text of ``lines.csv``."""
    return table_text(LINE_COLUMNS, map(line_row, lines))


def write_lines(path: str | Path, lines: Iterable[SpaceLine]) -> None:
    """Write ``lines.csv``, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_whole(path, lines_csv(lines))
