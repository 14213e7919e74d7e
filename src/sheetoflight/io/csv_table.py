"""Comma-separated tables: rows by column name, every complaint with file and line."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.quoting import file_name, one_line, shown
from sheetoflight.io.reading import read_text

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_WHOLE = re.compile(r"\d{1,9}", re.ASCII)
_OTHER_DELIMITERS = {";": "';'", "\t": "a tab", "|": "'|'"}


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Parameters
    ----------
    place : str
        File and line, for messages.
    cells : dict
        Text by column name.
    """

    place: str
    cells: dict[str, str]

    def text(self, column: str) -> str:
        """The cell's text, which must not be empty."""
        if not self.cells[column]:
            raise InputError(f"{self.place}: '{column}' is empty", "give a name")
        return self.cells[column]

    def number(self, column: str) -> float:
        """The cell as a finite number."""
        value = self.optional_number(column)
        if value is None:
            raise InputError(
                f"{self.place}: '{column}' is empty, expected a number",
                "give it, or remove the row of a point that was not seen",
            )
        return value

    def optional_number(self, column: str) -> float | None:
        """The cell as a finite number; None where it is empty or the column is absent."""
        text = self.cells.get(column, "").strip()
        if not text:
            return None
        value = float(text) if _NUMBER.fullmatch(text) else float("nan")
        if not abs(value) < float("inf"):
            raise InputError(
                f"{self.place}: '{column}' is {shown(text)}, expected a finite number",
                "correct it, or remove the row of a point that was not seen",
            )
        return value

    def optional_positive(self, column: str) -> float | None:
        """The cell as a number above zero; None where it is empty or the column is absent."""
        value = self.optional_number(column)
        if value is not None and value <= 0:
            raise InputError(
                f"{self.place}: '{column}' is {value}, expected a number above zero",
                "correct it, or leave it empty where it is unknown",
            )
        return value

    def optional_not_negative(self, column: str) -> float | None:
        """The cell as a number of 0 or more; None where it is empty or the column is absent."""
        value = self.optional_number(column)
        if value is not None and value < 0:
            raise InputError(
                f"{self.place}: '{column}' is {value}, expected a number of 0 or more",
                "correct it, or leave it empty where it is unknown",
            )
        return value

    def whole(self, column: str) -> int | None:
        """The cell as a whole number of 0 or more; None where it is none."""
        text = self.cells[column].strip()
        return int(text) if _WHOLE.fullmatch(text) else None


def read_table(
    path: str | Path, required: Sequence[str], optional: Sequence[str] = ()
) -> list[Row]:
    """The rows below a table's header, blank lines left out.

    Raises
    ------
    InputError
        If a column is missing, unknown or given twice, a row has too many or too few cells, or
        there is no row at all.
    FileError
        If the file cannot be read as text.
    """
    lines = _lines(file_name(path), read_text(path))
    place, header = next(lines)
    columns = [cell.strip() for cell in header]
    _check_header(place, columns, required, optional)
    rows = [_row(place, columns, cells) for place, cells in lines]
    if not rows:
        raise InputError(
            f"{file_name(path)} holds a header and no row", "check that it was written to the end"
        )
    return rows


def table_text(columns: Sequence[str] | None, rows: Iterable[Sequence[str | int | float]]) -> str:
    """A table as text, or rows alone where there are no column names; numbers with as many digits
    as bring the same value back."""
    lines = [*([columns] if columns else []), *rows]
    return "".join(",".join(_cell(value) for value in line) + "\n" for line in lines)


def _cell(value: str | int | float) -> str:
    if not isinstance(value, str):
        return repr(value)
    quotes = any(c in value for c in ',"\r\n')
    return '"' + value.replace('"', '""') + '"' if quotes else value


def _lines(name: str, text: str) -> Iterator[tuple[str, list[str]]]:
    """Every line that is not blank, with its place."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    while True:
        place = f"{name} line {reader.line_num + 1}"
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise FileError(
                f"{place} is no comma-separated text ({one_line(str(error))})",
                "check the quotes and the lengths of the cells",
            ) from error
        if cells and (len(cells) > 1 or cells[0].strip()):
            yield place, cells


def _check_header(
    place: str, columns: list[str], required: Sequence[str], optional: Sequence[str]
) -> None:
    expected = ",".join(required)
    if len(columns) == 1:
        for delimiter, name in _OTHER_DELIMITERS.items():
            if delimiter in columns[0]:
                raise InputError(
                    f"{place}: the columns are separated by {name}, expected ','",
                    f"write the header as {expected}",
                )
    for column in columns:
        if column not in required and column not in optional:
            further = f", and if you like {','.join(optional)}" if optional else ""
            raise InputError(f"{place}: unknown column {shown(column)}", f"use {expected}{further}")
        if columns.count(column) > 1:
            raise InputError(f"{place}: column '{column}' is given twice", "keep one of them")
    for column in required:
        if column not in columns:
            raise InputError(
                f"{place}: column '{column}' is missing", f"write the header as {expected}"
            )


def _row(place: str, columns: list[str], cells: list[str]) -> Row:
    if len(cells) != len(columns):
        raise InputError(
            f"{place} has {len(cells)} cells, expected {len(columns)}",
            "separate cells by ',' and write decimals with '.'",
        )
    return Row(place, dict(zip(columns, cells, strict=True)))
