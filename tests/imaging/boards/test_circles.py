"""Grids of circles, drawn with known centres: places, perspective, numbering, bad pictures."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sheetoflight.imaging.boards import find_board
from sheetoflight.imaging.boards.circle_centres import centres_of
from sheetoflight.model.board import PlanarBoard
from tests.imaging.boards.drawing import draw, light_of, photographed, truth, view

PLAIN = PlanarBoard("circles", 9, 7, (20.0, 20.0))
EVEN = PlanarBoard("circles", 5, 8, (15.0, 15.0), staggered=True)
ODD = PlanarBoard("circles", 4, 11, (15.0, 15.0), staggered=True)
BOARDS = {"plain": PLAIN, "even": EVEN, "odd": ODD}


def oblique(board, **more):
    return view(board, **({"tilt": 0.5, "spin": 0.3, "roll": 0.2} | more))


@cache
def picture_of(name, light=False):
    return draw(BOARDS[name], oblique(BOARDS[name]), light=light)


def turned(board, uv):
    return uv.reshape(board.rows, board.columns, 2)[::-1, ::-1].reshape(-1, 2)


def error_of(board, uv, drawn):
    """Errors under the better of the numberings that half a turn exchanges."""
    both = [uv - drawn, turned(board, uv) - drawn]
    return min(both, key=lambda e: float(np.nanmax(np.abs(e))))


@pytest.mark.parametrize("light", [False, True], ids=["dark", "light"])
@pytest.mark.parametrize("name", BOARDS)
def test_centres_lie_where_they_were_drawn(name, light):
    board = BOARDS[name]
    search = find_board(picture_of(name, light), board)
    assert search.sighting is not None, search.reason
    error = error_of(board, search.sighting.uv, truth(oblique(board), board))
    assert np.sqrt(np.nanmean(error**2)) < 0.01
    assert np.abs(np.nanmean(error, axis=0)).max() < 0.004
    assert np.isfinite(error).all()


@pytest.mark.parametrize("roll", [0.0, 1.0, 2.2, 3.1, -1.4])
@pytest.mark.parametrize("name", BOARDS)
def test_numbering_follows_the_right_hand(name, roll):
    """A grid with an odd number of staggered rows looks the same from its back."""
    board = BOARDS[name]
    matrix = oblique(board, roll=roll, distance=500.0)
    search = find_board(draw(board, matrix, samples=3), board)
    assert search.sighting is not None, search.reason
    error = error_of(board, search.sighting.uv, truth(matrix, board))
    assert np.nanmax(np.abs(error)) < 0.1


def ellipses(matrix, board):
    """Middles and frames of the circles' images, from conics: ``C' = H⁻ᵀ C H⁻¹``."""
    inverse = np.linalg.inv(matrix)
    middles, frames = [], []
    for x, y, _ in board.points:
        to_unit = np.array([[1, 0, -x], [0, 1, -y], [0, 0, board.circle_diameter / 2]])
        to_unit /= board.circle_diameter / 2
        conic = inverse.T @ to_unit.T @ np.diag([1.0, 1.0, -1.0]) @ to_unit @ inverse
        middle = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
        level = conic[2, 2] + conic[:2, 2] @ middle
        frames.append(np.linalg.inv(np.linalg.cholesky(-conic[:2, :2] / level).T))
        middles.append(middle)
    return np.array(middles), np.array(frames)


def test_perspective_moves_an_ellipse_and_the_correction_moves_it_back():
    """Large circles close by at 57°. A mirror-symmetric board's mean bias would hide in the
    homography; the law is for each circle on its own."""
    board = PlanarBoard("circles", 7, 5, (20.0, 20.0), circle_mm=14.0)
    matrix = view(board, tilt=1.0, spin=0.3, distance=250.0, focal=700.0)
    middles, frames = ellipses(matrix, board)
    drawn = truth(matrix, board)
    assert np.linalg.norm(middles - drawn, axis=1).max() > 0.3
    corrected = centres_of(middles, frames, board)
    assert np.linalg.norm(corrected - drawn, axis=1).max() < 0.01


def test_found_centres_are_free_of_the_perspective_bias():
    board = PlanarBoard("circles", 7, 5, (20.0, 20.0), circle_mm=14.0)
    matrix = view(board, tilt=0.9, spin=0.2, distance=320.0, focal=900.0)
    search = find_board(draw(board, matrix, noise=0.5), board)
    assert search.sighting is not None, search.reason
    middles, _ = ellipses(matrix, board)
    drawn = truth(matrix, board)
    bias = (middles - drawn) / np.linalg.norm(middles - drawn, axis=1)[:, None]
    assert np.linalg.norm(middles - drawn, axis=1).mean() > 0.1
    left = (error_of(board, search.sighting.uv, drawn) * bias).sum(axis=1)
    assert abs(np.nanmean(left)) < 0.01


def test_scatter_of_centres_is_their_std():
    """63 centres in 8 pictures: 882 degrees of freedom, the ratio is known to 2.4 %."""
    light = light_of(PLAIN, oblique(PLAIN), samples=3)
    found = [find_board(photographed(light, noise=8.0, seed=s), PLAIN).sighting for s in range(8)]
    uv = np.array([f.uv for f in found if f is not None])
    std = np.array([f.std for f in found if f is not None])
    assert len(uv) == 8
    scatter = np.sqrt(np.nanvar(uv, axis=0, ddof=1).mean())
    assert 0.8 < scatter / np.sqrt(np.nanmean(std**2)) < 1.2


def test_circles_beside_a_laser_line_are_not_believed():
    light = light_of(PLAIN, oblique(PLAIN), laser=((300.0, 200.0), 1.4, 2.0, 300.0))
    search = find_board(photographed(light), PLAIN)
    assert search.sighting is not None, search.reason
    error = error_of(PLAIN, search.sighting.uv, truth(oblique(PLAIN), PLAIN))
    assert 50 <= np.isfinite(error[:, 0]).sum() <= 61
    assert np.nanmax(np.abs(error)) < 0.05


@pytest.mark.parametrize(
    ("name", "step"),
    [("plain", (1, 0)), ("plain", (-1, 0)), ("plain", (0, 1)), ("odd", (1, 0)), ("odd", (0, -1)),
     ("even", (-1, 0)), ("even", (0, 1))],
)  # fmt: skip
def test_the_wrong_size_is_told(name, step):
    board = BOARDS[name]
    asked = replace(board, columns=board.columns + step[0], rows=board.rows + step[1])
    search = find_board(picture_of(name), asked)
    assert search.sighting is None
    assert f"{asked.columns} × {asked.rows}" in search.reason
    assert f"{board.columns} × {board.rows} circles" in search.reason or "larger" in search.reason


def test_a_mirrored_staggered_grid_of_even_rows_is_told():
    search = find_board(np.ascontiguousarray(picture_of("even")[:, ::-1]), EVEN)
    assert search.sighting is None
    assert "mirrored" in search.reason


def test_two_grids_are_refused():
    left, right = (view(PLAIN, distance=900.0, shift=(s, 0.0)) for s in (180.0, -180.0))
    light = light_of(PLAIN, right, under=light_of(PLAIN, left))
    search = find_board(photographed(light), PLAIN)
    assert search.sighting is None
    assert "two boards" in search.reason


def test_a_plain_wall_has_no_circles():
    search = find_board(photographed(np.full((480, 640), 90.0)), PLAIN)
    assert search.sighting is None
    assert "no grid of 9 × 7 circles" in search.reason
