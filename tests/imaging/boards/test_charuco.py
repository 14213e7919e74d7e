"""Charuco boards, drawn with known corners: whole, in part, old, mirrored, misnamed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sheetoflight.imaging.boards import find_board
from sheetoflight.model.board import PlanarBoard
from tests.imaging.boards.drawing import draw, photographed, truth, view

BOARD = PlanarBoard("charuco", 9, 6, (20.0, 20.0))
OBLIQUE = view(BOARD, tilt=0.4, spin=0.3, roll=0.2)


@cache
def whole():
    return draw(BOARD, OBLIQUE)


def errors(picture, board, matrix):
    search = find_board(picture, board)
    assert search.sighting is not None, search.reason
    return search.sighting.uv - truth(matrix, board), search.sighting.std


def test_corners_lie_where_they_were_drawn_under_their_own_numbers():
    error, std = errors(whole(), BOARD, OBLIQUE)
    assert np.isfinite(error[:, 0]).sum() >= 50
    rms = np.sqrt(np.nanmean(error**2))
    assert rms < 0.05
    assert np.abs(np.nanmean(error, axis=0)).max() < 0.02
    assert 0.5 < rms / np.nanmedian(std) < 1.5


@pytest.mark.parametrize("roll", [1.5, 3.0, -1.5])
def test_a_turned_board_keeps_its_numbers(roll):
    matrix = view(BOARD, tilt=0.3, roll=roll, distance=550.0)
    error, _ = errors(draw(BOARD, matrix, samples=4), BOARD, matrix)
    assert np.isfinite(error[:, 0]).mean() > 0.8
    assert np.nanmax(np.abs(error)) < 0.3


def test_a_part_of_the_board_is_enough():
    matrix = view(BOARD, tilt=0.4, spin=0.3, roll=0.2, shift=(60.0, 50.0))
    error, std = errors(draw(BOARD, matrix), BOARD, matrix)
    seen = np.isfinite(error[:, 0])
    assert 20 < seen.sum() < len(seen)
    assert np.array_equal(seen, np.isfinite(std))
    assert np.nanmax(np.abs(error)) < 0.3


@pytest.mark.parametrize("old", [False, True], ids=["today's", "before OpenCV 4.6"])
def test_both_patterns_of_an_even_number_of_rows_of_squares_are_read(old):
    board = PlanarBoard("charuco", 8, 7, (20.0, 20.0))
    matrix = view(board, tilt=0.4)
    error, _ = errors(draw(board, matrix, light_first=old), board, matrix)
    assert np.nanmax(np.abs(error)) < 0.2


def test_a_mirrored_picture_is_called_mirrored():
    search = find_board(np.ascontiguousarray(whole()[:, ::-1]), BOARD)
    assert search.sighting is None
    assert "mirrored" in search.reason


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"columns": 8}, "columns and rows"),
        ({"columns": 19, "rows": 16}, "markers"),
        ({"dictionary": "DICT_6X6_50"}, "DICT_6X6_50"),
        ({"dictionary": "QR"}, "DICT_4X4_50"),
    ],
)
def test_a_wrong_description_is_told(wrong, words):
    search = find_board(whole(), replace(BOARD, **wrong))
    assert search.sighting is None
    assert words in search.reason


def test_a_plain_wall_has_no_markers():
    search = find_board(photographed(np.full((480, 640), 90.0)), BOARD)
    assert search.sighting is None
    assert "no marker" in search.reason
