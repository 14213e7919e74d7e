"""Point clouds as text: ``.csv`` with a header and all columns, ``.xyz`` without."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.io.clouds.columns import COORDINATES, columns
from sheetoflight.model.point_cloud import PointCloud

_BLOCK = 10_000  # rows: a long scan never stands in memory as text


def write_csv(path: Path, cloud: PointCloud) -> None:
    """Write ``picture,line,u,v,x,y,z,std_mm,noise_mm,std_x_mm,std_y_mm,std_z_mm,peak``.

    ``picture`` is the picture's name, quoted where it holds a comma or a quote. Numbers have as
    many digits as bring the same value back.
    """
    table: dict[str, NDArray[Any]] = columns(cloud)
    table["picture"] = np.array(cloud.pictures, dtype=object)[table["picture"]]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(_rows(list(table.values())))


def write_xyz(path: Path, cloud: PointCloud) -> None:
    """Write ``x y z std_mm``, one point a line, in mm, separated by one space.

    There is no header and no comment: many readers refuse them.
    """
    table = columns(cloud)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter=" ", lineterminator="\n")
        writer.writerows(_rows([table[name] for name in (*COORDINATES, "std_mm")]))


def _rows(table: Sequence[NDArray[Any]]) -> Iterator[tuple[Any, ...]]:
    """The rows of columns, as Python's own numbers: they are written with their shortest digits."""
    for start in range(0, len(table[0]), _BLOCK):
        part = slice(start, start + _BLOCK)
        yield from zip(*(column[part].tolist() for column in table), strict=True)
