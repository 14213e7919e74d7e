"""Points of a board as a grid in the picture: its steps, its sense and its numbering.

A grid is an array ``(rows, columns, 2)`` of image points, px.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array

_MOST_UNEVEN = 0.2


def steps(grid: Array) -> tuple[Array, Array]:
    """Vectors ``(rows, columns, 2)`` px from each point to the next column and the next row."""
    return np.gradient(grid, axis=1), np.gradient(grid, axis=0)


def cross(a: Array, b: Array) -> Array:
    """``a_u b_v − a_v b_u`` of vectors ``(..., 2)``."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def is_mirrored(grid: Array) -> bool:
    """Whether the board's x and y axes turn the wrong way round for its printed side."""
    return bool(np.median(cross(*steps(grid))) < 0)


def room(grid: Array) -> Array:
    """Half the side ``(rows, columns)`` px of the largest upright square about each point that no
    other line of the grid runs through."""
    a, b = steps(grid)
    area = np.abs(cross(a, b))
    return area / np.maximum(np.abs(a).sum(axis=-1), np.abs(b).sum(axis=-1))


def is_even(grid: Array) -> bool:
    """Whether each point lies about midway between its neighbours, as perspective, lenses and
    bent boards leave it, and a grid put together wrongly does not."""
    for g in (grid, grid.transpose(1, 0, 2)):
        if len(g) < 3:
            continue
        off = np.linalg.norm(g[:-2] - 2.0 * g[1:-1] + g[2:], axis=-1)
        if (off > _MOST_UNEVEN * np.linalg.norm(g[2:] - g[:-2], axis=-1)).any():
            return False
    return True


def spacing(grid: Array) -> float:
    """Median distance of neighbouring lines of the grid, px."""
    a, b = steps(grid)
    longer = np.maximum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))
    return float(np.median(np.abs(cross(a, b)) / longer))


def numberings(grid: Array, columns: int, rows: int) -> list[Array]:
    """Every numbering of the same points with the board's columns and rows that runs the right
    way round: x × y points away from the camera.

    Two that differ by half a turn, or four of a board with as many columns as rows.
    """
    both = (grid, grid.transpose(1, 0, 2))
    shaped = [g for g in both if g.shape[:2] == (rows, columns)]
    turned = [g[::v, ::u] for g in shaped for u in (1, -1) for v in (1, -1)]
    return [np.ascontiguousarray(g) for g in turned if not is_mirrored(g)]


def upper_left_first(choices: list[Array]) -> Array:
    """The numbering whose first point lies nearest to the picture's upper left corner."""
    return min(choices, key=lambda g: (float(g[0, 0].sum()), tuple(g[0, 0])))


def one_more(grid: Array) -> list[Array]:
    """The lines of points ``(n, 2)`` that would follow on the grid's four sides."""
    sides = (grid, grid[::-1], grid.transpose(1, 0, 2), grid.transpose(1, 0, 2)[::-1])
    return [_continued(side) for side in sides]


def _continued(grid: Array) -> Array:
    """The row before the first: along a parabola where there are three."""
    if len(grid) < 3:
        return 2.0 * grid[0] - grid[1]
    return 3.0 * grid[0] - 3.0 * grid[1] + grid[2]


def outline(grid: Array) -> Array:
    """Corners ``(4, 2)`` px of the grid with one further square around it, in order."""
    low, high = 2.0 * grid[0] - grid[1], 2.0 * grid[-1] - grid[-2]
    return np.stack(
        [2 * low[0] - low[1], 2 * low[-1] - low[-2], 2 * high[-1] - high[-2], 2 * high[0] - high[1]]
    )
