"""Known lengths to verify against: a table ``segment,known_mm[,known_std_mm]``."""

from __future__ import annotations

from pathlib import Path

from sheetoflight.errors import InputError
from sheetoflight.io.csv_table import Row, read_table
from sheetoflight.io.quoting import shown
from sheetoflight.measurement.comparison import KnownLength

KNOWN_COLUMNS = ("segment", "known_mm")
OPTIONAL_KNOWN_COLUMNS = ("known_std_mm",)


def read_known(path: str | Path) -> dict[str, KnownLength]:
    """Known lengths by segment, in the order of their rows.

    Raises
    ------
    InputError
        For anything that is wrong with the table, naming file and line: columns, numbers, a
        segment given twice.
    FileError
        If the file cannot be read as text.
    """
    known: dict[str, KnownLength] = {}
    for row in read_table(path, KNOWN_COLUMNS, OPTIONAL_KNOWN_COLUMNS):
        name = row.text("segment")
        if name in known:
            raise InputError(
                f"{row.place}: segment {shown(name)} is given twice", "keep one of the rows"
            )
        known[name] = _known_length(row)
    return known


def _known_length(row: Row) -> KnownLength:
    try:
        return KnownLength(row.number("known_mm"), row.optional_number("known_std_mm") or 0.0)
    except InputError as error:
        if error.what.startswith(row.place):
            raise
        raise InputError(f"{row.place}: {error.what}", error.remedy) from error
