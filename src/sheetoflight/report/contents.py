"""What a caller may add to the report: measured pictures, and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.measurement.comparison import MeasuredSegment
from sheetoflight.model.line_piece import LinePiece


@dataclass(frozen=True)
class MeasuredPicture:
    """A picture in which pieces of the laser line were measured.

    Parameters
    ----------
    name : str
    image : (H, W) array of uint8 or uint16
        The grey picture with the laser on.
    binary : (H, W) array of bool, optional
        The pixels that belong to the laser line.
    pieces : tuple of LinePiece
        The pieces of the line that were found.
    segments : tuple of MeasuredSegment
        The lengths of the whole pieces, in the order of `pieces`.
    laser : str, optional
        In whose sheet the line lies; may be left out where there is one laser.

    Raises
    ------
    InputError
        If the picture is not grey with 8 or 16 bit, the binary picture has another size, or
        there is not one length for each whole piece.
    """

    name: str
    image: np.ndarray
    binary: np.ndarray | None = None
    pieces: tuple[LinePiece, ...] = ()
    segments: tuple[MeasuredSegment, ...] = ()
    laser: str | None = None

    def __post_init__(self) -> None:
        if self.image.ndim != 2 or self.image.dtype not in (np.uint8, np.uint16):
            raise InputError(
                f"picture {self.name} has shape {self.image.shape} and type {self.image.dtype}",
                "give a grey picture (H, W) of 8 or 16 bit",
            )
        if self.binary is not None and self.binary.shape != self.image.shape:
            raise InputError(
                f"picture {self.name}: the binary picture has shape {self.binary.shape}, the "
                f"picture {self.image.shape}",
                "give both at the same size",
            )
        whole = sum(piece.whole for piece in self.pieces)
        if len(self.segments) != whole:
            raise InputError(
                f"picture {self.name} has {whole} whole pieces and {len(self.segments)} lengths",
                "give the length of each whole piece",
            )


@dataclass(frozen=True)
class Table:
    """A table for the report.

    Parameters
    ----------
    title : str
    columns : tuple of str
        Headings.
    rows : tuple of tuples of str, int or float
        One cell for each column; text is shown as it is, a float with six significant digits.
    note : str
        A sentence below the table.
    highlight : tuple of int
        Rows that are set off from the others, counted from 0.

    Raises
    ------
    InputError
        If a row has not one cell for each column, or a row to highlight does not exist.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | int | float, ...], ...]
    note: str = ""
    highlight: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise InputError(
                    f"table '{self.title}': row {number} has {len(row)} cells, there are "
                    f"{len(self.columns)} columns",
                    "give one cell for each column",
                )
        outside = [row for row in self.highlight if not 0 <= row < len(self.rows)]
        if outside:
            raise InputError(
                f"table '{self.title}': row {outside[0]} is to be highlighted, there are "
                f"{len(self.rows)} rows",
                "count the rows from 0",
            )
