"""Corners of boards as Bouguet's toolbox keeps them: ``calib_data.mat``, ``Calib_Results.mat``.

View k has ``x_k`` (2 x N, px) and ``X_k`` (3 x N, mm, in the board's frame); a view without
corners holds NaN or is missing. Pixel (0, 0) is the centre of the first one: the toolbox takes one
from MATLAB's coordinates before it keeps them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.exchange.mat_reading import (
    LIMIT_BYTES,
    Value,
    mat_names,
    mat_variables,
    real_numbers,
)
from sheetoflight.io.exchange.values import image_size, named
from sheetoflight.io.reading import read_bytes
from sheetoflight.model.board_views import BoardViews

_SAME_MM = 1e-6
"""Board points nearer to each other than this are one."""

_MOST_POINTS = 100_000


def read_bouguet_corners(path: str | Path) -> tuple[Array, BoardViews]:
    """Board points and where they were seen.

    Views may show different parts of the board: the points are all that any view shows, in the
    order in which they come first.

    Returns
    -------
    points : (M, 3) array
        In the board's frame, mm.
    views : BoardViews
        Named by the toolbox's numbers; NaN where a point was not seen.

    Raises
    ------
    FileError
        If the file cannot be read, or is no MATLAB file of version 5.
    InputError
        If it holds no corners, or those of a view do not agree with its board points.
    """
    data = read_bytes(path, LIMIT_BYTES)
    with named(path):
        there = set(mat_names(data))
        numbers = sorted(
            int(name[2:])
            for name in there
            if re.fullmatch(r"x_[1-9][0-9]{0,5}", name) and f"X_{name[2:]}" in there
        )
        names = [f"{letter}_{k}" for k in numbers for letter in ("x", "X")]
        found = mat_variables(data, [*names, "active_images"])
        active = _active(found)
        views = {k: _view(found, k) for k in numbers if k not in active or active[k]}
        return _joined({k: view for k, view in views.items() if len(view[0])})


def bouguet_image_size(path: str | Path) -> tuple[int, int] | None:
    """Width and height of the pictures, nx and ny; None where the file does not say them.

    Raises
    ------
    FileError
        If the file cannot be read, or is no MATLAB file of version 5.
    InputError
        If they are no whole numbers above zero.
    """
    with named(path):
        found = mat_variables(read_bytes(path, LIMIT_BYTES), ("nx", "ny"))
        if len(found) < 2:
            return None
        sides = [real_numbers(found, name).ravel().tolist() for name in ("nx", "ny")]
        return image_size([side for of_one in sides for side in of_one], "nx, ny")


def _active(found: dict[str, Value]) -> dict[int, bool]:
    """Whether each view was switched on, by its number, for those of which it is said."""
    if "active_images" not in found:
        return {}
    flags = real_numbers(found, "active_images").ravel()
    return {k: bool(flag) for k, flag in enumerate(flags.tolist(), 1)}


def _view(found: dict[str, Value], k: int) -> tuple[Array, Array]:
    """Image points ``(n, 2)`` and board points ``(n, 3)`` of a view; none where it has none."""
    uv, points = real_numbers(found, f"x_{k}"), real_numbers(found, f"X_{k}")
    if not np.isfinite(uv).any():
        return np.zeros((0, 2)), np.zeros((0, 3))
    if uv.shape[0] != 2 or points.shape != (3, uv.shape[1]):
        raise InputError(
            f"x_{k} is {uv.shape[0]} x {uv.shape[1]} and X_{k} {points.shape[0]} x "
            f"{points.shape[1]}",
            "expected 2 x N and 3 x N",
        )
    seen = np.isfinite(uv).all(axis=0)
    if not np.isfinite(points[:, seen]).all() or np.abs(points[:, seen]).max() > 1e9:
        raise InputError(f"X_{k} has no number for a corner that x_{k} has", "remove that corner")
    return uv[:, seen].T, points[:, seen].T


def _joined(views: dict[int, tuple[Array, Array]]) -> tuple[Array, BoardViews]:
    if not views:
        raise InputError("there are no corners in it", "give a file with x_1, X_1, x_2, X_2 …")
    places: dict[tuple[int, ...], int] = {}
    points: list[Array] = []
    numbers = {k: _numbered(k, view[1], places, points) for k, view in views.items()}
    if len(points) * len(views) > 10 * _MOST_POINTS:
        raise InputError(
            f"{len(views)} views show {len(points)} different points",
            "give the corners of one board, in its own frame",
        )
    uv = np.full((len(views), len(points), 2), np.nan)
    for row, (k, view) in enumerate(views.items()):
        uv[row, numbers[k]] = view[0]
    return np.array(points), BoardViews(tuple(str(k) for k in views), uv)


def _numbered(
    k: int, shown: Array, places: dict[tuple[int, ...], int], points: list[Array]
) -> list[int]:
    """Number of each board point of a view; new ones are added to the others."""
    found = []
    for point, key in zip(shown, np.rint(shown / _SAME_MM).astype(np.int64).tolist(), strict=True):
        place = places.setdefault(tuple(key), len(points))
        if place == len(points):
            points.append(point)
        found.append(place)
    if len(set(found)) < len(found):
        raise InputError(f"X_{k} holds a board point twice", "remove one of the two corners")
    return found
