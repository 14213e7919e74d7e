"""Rows, columns and ridges of targets."""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.known_lines import printed_lines, ridges
from sheetoflight.model.board import PlanarBoard, SolidTarget
from sheetoflight.simulation.bodies import folded_body

BOOK = folded_body()


def test_rows_and_columns_of_a_body_are_found() -> None:
    """Diagonals are straight too, but their points are in a row and a column already."""
    for face in (0, 1):
        lines = printed_lines(BOOK, face)
        assert len(lines) == 10
        points = BOOK.points[np.array(lines)]
        steps = np.diff(points, axis=1)
        assert np.allclose(np.linalg.norm(steps, axis=2), 25.0)
        assert np.allclose(steps, steps[:, :1])
        assert np.bincount(np.concatenate(lines))[list(BOOK.face_points[face])].tolist() == [2] * 25


def test_rows_of_a_staggered_board_are_straight() -> None:
    board = PlanarBoard("circles", 4, 5, (10.0, 10.0), staggered=True)
    lines = printed_lines(board, 0)
    assert sorted(len(line) for line in lines) == [3] * 4 + [4] * 5  # columns of 2 are too short
    for line in lines:
        assert np.linalg.matrix_rank(board.points[line] - board.points[line[0]]) == 1


def test_a_ridge_is_where_two_faces_meet() -> None:
    ((faces, ends),) = ridges(BOOK)
    assert faces == (0, 1)
    assert sorted(BOOK.points[list(ends)].tolist()) == [[0, 0, 0], [0, 100, 0]]
    apart = SolidTarget(BOOK.points, [range(1, 5), range(25, 50)][1:])
    assert ridges(apart) == []
