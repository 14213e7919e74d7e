"""``segments.csv``: pairs of image points on the laser line; ``lengths.csv``: their lengths."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.csv_table import Row, read_table, table_text
from sheetoflight.io.quoting import shown

SEGMENT_COLUMNS = ("segment", "u1", "v1", "u2", "v2")
OPTIONAL_SEGMENT_COLUMNS = ("std", "laser", "known_mm", "known_std_mm")
LENGTH_COLUMNS = ("segment", "length_mm", "std_mm", "low_mm", "high_mm")

LengthRow = tuple[str, float, float, tuple[float, float]]
"""Name, length, standard uncertainty, and the bounds of the 95 % interval; mm."""


@dataclass(frozen=True)
class Segments:
    """Segments to be measured.

    Parameters
    ----------
    names : tuple of str
        A name for each of the N segments, unique.
    uv : (N, 2, 2) array
        First and second end of each in px.
    std : (N,) array, optional
        Standard uncertainty of each image coordinate in px; NaN or absent where unknown.
    known_mm : (N,) array, optional
        Known length of each in mm; NaN or absent where unknown.
    known_std_mm : (N,) array, optional
        Standard uncertainty of each known length in mm, 0 where it is exact; NaN or absent where
        unknown.
    laser : tuple of str or None, optional
        Name of the sheet of light that each lies on, None for a segment without; absent where
        no segment names one.
    """

    names: tuple[str, ...]
    uv: Array
    std: Array | None = None
    known_mm: Array | None = None
    known_std_mm: Array | None = None
    laser: tuple[str | None, ...] | None = None

    def __len__(self) -> int:
        return len(self.names)


def read_segments(path: str | Path) -> Segments:
    """Segments of ``segments.csv``, in the order of their rows.

    Raises
    ------
    InputError
        For anything that is wrong with the table, naming file and line: columns, numbers, a
        segment given twice, a segment whose ends are one point, an uncertainty of a known length
        without the length.
    FileError
        If the file cannot be read as text.
    """
    rows = read_table(path, SEGMENT_COLUMNS, OPTIONAL_SEGMENT_COLUMNS)
    ends: dict[str, list[list[float]]] = {}
    for row in rows:
        name = row.text("segment")
        if name in ends:
            raise InputError(
                f"{row.place}: segment {shown(name)} is given twice",
                "give every segment a name of its own",
            )
        ends[name] = _ends(row, name)
        _check_known(row, name)
    return Segments(
        tuple(ends),
        np.array(list(ends.values())),
        std=_numbers(row.optional_positive("std") for row in rows),
        known_mm=_numbers(row.optional_positive("known_mm") for row in rows),
        known_std_mm=_numbers(row.optional_not_negative("known_std_mm") for row in rows),
        laser=_lasers(rows),
    )


def lengths_csv(rows: Iterable[LengthRow]) -> str:
    """The text of ``lengths.csv``.

    Raises
    ------
    InputError
        If a number is not finite.
    """
    flat = [(name, float(mm), float(std), *map(float, bounds)) for name, mm, std, bounds in rows]
    for name, *numbers in flat:
        if not all(map(math.isfinite, numbers)):
            raise InputError(
                f"segment {shown(name)} has no finite length and uncertainty: {numbers}",
                "check that its ends lie on the laser line, or remove it",
            )
    return table_text(LENGTH_COLUMNS, flat)


def write_lengths(path: str | Path, rows: Iterable[LengthRow]) -> None:
    """Write ``lengths.csv``, whole or not at all.

    Raises
    ------
    InputError
        If a number is not finite.
    FileError
        If the file cannot be written.
    """
    write_whole(path, lengths_csv(rows))


def _ends(row: Row, name: str) -> list[list[float]]:
    u1, v1, u2, v2 = (row.number(column) for column in SEGMENT_COLUMNS[1:])
    if (u1, v1) == (u2, v2):
        raise InputError(
            f"{row.place}: both ends of segment {shown(name)} are the same point",
            "give two different points on the laser line",
        )
    return [[u1, v1], [u2, v2]]


def _check_known(row: Row, name: str) -> None:
    """An uncertainty belongs to a length."""
    if row.optional_not_negative("known_std_mm") is None:
        return
    if row.optional_positive("known_mm") is None:
        raise InputError(
            f"{row.place}: known_std_mm of segment {shown(name)} is given without known_mm",
            "give the known length too, or remove its uncertainty",
        )


def _lasers(rows: list[Row]) -> tuple[str | None, ...] | None:
    """The names of column ``laser``, None where empty; None where no row has one."""
    names = tuple(row.cells.get("laser", "").strip() or None for row in rows)
    return names if any(names) else None


def _numbers(column: Iterable[float | None]) -> Array | None:
    """A column's numbers, NaN where empty; None where no row has one."""
    values = list(column)
    if all(value is None for value in values):
        return None
    return np.array([math.nan if value is None else value for value in values])
