"""Straight lines that a target's known points form: rows, columns and ridges."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, PlanarBoard, SolidTarget

_FEWEST = 3
"""Points whose cross-ratio with a fourth fixes that."""

_SAME = 1e-6
"""Distance, as a part of the target's size, that is rounding."""

_AT_MOST = 2
"""Lines that a point is used in: a row and a column. Its noise is in all of them."""


def printed_lines(board: Board, face: int) -> list[np.ndarray]:
    """The straight lines of three or more known points on a face, by the points' numbers in their
    order along the line.

    Rows and columns of a flat board; of a solid body's face the lines of the most points, the
    shorter first, as long as no point is in more than two of them.
    """
    if isinstance(board, PlanarBoard):
        numbers = np.arange(len(board.points))
        lines = [
            numbers[board.points[:, axis] == place]
            for axis in (1, 0)
            for place in np.unique(board.points[:, axis])
        ]
        return [line for line in lines if len(line) >= _FEWEST]
    own = np.array(sorted(set(board.face_points[face])))
    size = float(np.ptp(board.points, axis=0).max())
    lines = [own[line] for line in _collinear(board.points[own], _SAME * size)]
    return _of_few_uses(lines, board.points)


def _collinear(points: Array, tolerance: float) -> list[np.ndarray]:
    """Every largest set of three or more points ``(n, 3)`` on one line, in order along it."""
    found = []
    for first in range(len(points)):
        offset = points - points[first]
        away = np.linalg.norm(offset, axis=1)
        left = np.flatnonzero(away > tolerance)
        while left.size:
            way = offset[left[0]] / away[left[0]]
            beside = np.linalg.norm(offset[left] - np.outer(offset[left] @ way, way), axis=1)
            own = np.append(left[beside <= tolerance], first)
            left = left[beside > tolerance]
            if len(own) >= _FEWEST and own.min() == first:  # each set once
                found.append(own[np.argsort(offset[own] @ way, kind="stable")])
    return found


def _of_few_uses(lines: list[np.ndarray], points: Array) -> list[np.ndarray]:
    used = np.zeros(len(points), dtype=int)
    chosen = []
    lengths = [float(np.linalg.norm(points[line[-1]] - points[line[0]])) for line in lines]
    for number in sorted(range(len(lines)), key=lambda n: (-len(lines[n]), lengths[n])):
        if (used[lines[number]] < _AT_MOST).all():
            used[lines[number]] += 1
            chosen.append(lines[number])
    return chosen


def ridges(body: SolidTarget) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Pairs of faces that have an edge in common, and the two outermost points of that edge.

    An edge that is printed on both faces may have points of its own on each: they are common
    where they are in one place.
    """
    size = float(np.ptp(body.points, axis=0).max())
    found = []
    for pair in combinations(range(len(body.face_points)), 2):
        first, second = (np.array(sorted(set(body.face_points[face]))) for face in pair)
        apart = np.linalg.norm(body.points[first][:, None] - body.points[second], axis=2)
        common = first[(apart <= _SAME * size).any(axis=1)]
        if len(common) >= 2:
            along = np.linalg.norm(body.points[common] - body.points[common[0]], axis=1)
            end = int(common[np.argmax(along)])
            other = np.linalg.norm(body.points[common] - body.points[end], axis=1)
            found.append((pair, (int(common[np.argmax(other)]), end)))
    return found
