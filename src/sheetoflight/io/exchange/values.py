"""Numbers out of documents that other tools wrote, each checked, each wrong one named."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.quoting import file_name, shown
from sheetoflight.io.reading import naming
from sheetoflight.model.camera import Camera

Document = Mapping[str, Any]
"""A mapping of text to numbers, text, lists and further mappings."""

_MOST_NUMBERS = 1000
"""More numbers than this in one entry are no camera's parameters."""

_LARGEST_PICTURE = 1_000_000

_BROWN = 5

_FURTHER = {
    8: "the rational model k4, k5, k6",
    12: "the thin prism model s1 to s4",
    14: "a tilted sensor",
}
"""What the coefficients beyond the fifth are, by OpenCV's counts of coefficients."""


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Put the file's name before what any error from within says, a damaged file's too."""
    name = file_name(path)
    try:
        yield
    except InputError as error:
        if error.what.startswith(name):
            raise
        raise type(error)(f"{name}: {error.what}", error.remedy) from error


def number(value: object, key: str) -> float:
    """One finite number.

    Raises
    ------
    InputError
        If it is none; the key is named.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} is {shown(value)}, expected a number", "correct it")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise InputError(f"{key} is {shown(value)}, expected a finite number", "correct it")
    return found


def numbers(value: object, key: str) -> Array:
    """All numbers of a list, of nested lists or of a matrix with ``data``, row by row.

    Raises
    ------
    InputError
        If one is no finite number, there are more than a thousand, or ``rows`` and ``cols`` do
        not agree with ``data``.
    """
    found: list[float] = []
    _collect(_entries(value, key), key, found)
    return np.array(found, dtype=float)


def _entries(value: object, key: str) -> object:
    """The ``data`` of a matrix that is written as a mapping; all else as it is."""
    if not isinstance(value, Mapping):
        return value
    if "data" not in value:
        raise InputError(f"{key} is a table without 'data'", "give the numbers")
    data = value["data"]
    data = data if isinstance(data, list) else [data]
    if "rows" in value and "cols" in value:
        rows, columns = (whole(value[name], f"{key}.{name}") for name in ("rows", "cols"))
        if rows * columns != len(data):
            raise InputError(
                f"{key} has {rows} rows and {columns} columns, and {len(data)} numbers",
                "the file is damaged: write it again",
            )
    return data


def _collect(value: object, key: str, found: list[float]) -> None:
    if not isinstance(value, Sequence) or isinstance(value, str):
        found.append(number(value, key))
        return
    for index, entry in enumerate(value):
        _collect(entry, f"{key}[{index}]", found)
        if len(found) > _MOST_NUMBERS:
            raise InputError(
                f"{key} holds more than {_MOST_NUMBERS} numbers", "check that it is the right file"
            )


def counted_numbers(value: object, key: str, count: int) -> Array:
    """As `numbers`, of which there must be so many.

    Raises
    ------
    InputError
        As `numbers`, and if the count is another.
    """
    found = numbers(value, key)
    if len(found) != count:
        raise InputError(f"{key} has {len(found)} numbers, expected {count}", "correct it")
    return found


def whole(value: object, key: str) -> int:
    """A whole number, also where it is written with a point.

    Raises
    ------
    InputError
        If it is none.
    """
    found = number(value, key)
    if found != round(found):
        raise InputError(f"{key} is {shown(value)}, expected a whole number", "correct it")
    return round(found)


def image_size(value: object, key: str) -> tuple[int, int]:
    """Width and height in px, from a list of both.

    Raises
    ------
    InputError
        If they are no whole numbers between 1 and a million.
    """
    width, height = (whole(side, key) for side in counted_numbers(value, key, 2).tolist())
    if not (1 <= width <= _LARGEST_PICTURE and 1 <= height <= _LARGEST_PICTURE):
        raise InputError(
            f"{key} is {width} x {height}", "give width and height of the pictures in px"
        )
    return width, height


def brown(value: object, key: str) -> tuple[float, ...]:
    """OpenCV's ``(k1, k2, p1, p2, k3)`` from 0, 4, 5, or more where the further are zero.

    Raises
    ------
    InputError
        If the count is another, or a coefficient that has no place here is not zero.
    """
    found = numbers(value, key)
    if len(found) not in (0, 4, _BROWN, *_FURTHER):
        raise InputError(
            f"{key} has {len(found)} coefficients, expected k1, k2, p1, p2 and k3",
            "give 4 or 5 of them, in OpenCV's order",
        )
    if np.any(found[_BROWN:]):
        last = _BROWN + 1 + int(np.flatnonzero(found[_BROWN:])[-1])
        model = next(text for count, text in _FURTHER.items() if last <= count)
        raise InputError(
            f"{key} has {len(found)} coefficients and uses {model}, which has no place here",
            "calibrate again with the five coefficients k1, k2, p1, p2, k3",
        )
    return tuple(np.resize(np.append(found, np.zeros(_BROWN)), _BROWN).tolist())


def camera_of(
    size: tuple[int, int], matrix: Array, distortion: Sequence[float], key: str
) -> Camera:
    """A camera from its matrix ``(9,)``, row by row, and Brown's coefficients.

    Raises
    ------
    InputError
        If they are those of no camera; the key is named.
    """
    with naming(key):
        return Camera.from_matrix(size, matrix.reshape(3, 3), distortion)
