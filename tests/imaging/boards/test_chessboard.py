"""Chessboards, drawn with known corners: places, std, numbering, the laser line, bad pictures."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.boards import find_board
from sheetoflight.model.board import PlanarBoard
from tests.imaging.boards.drawing import draw, light_of, photographed, truth, view

BOARD = PlanarBoard("chessboard", 9, 6, (20.0, 20.0))
OBLIQUE = view(BOARD, tilt=0.4, spin=0.3, roll=0.2)


@cache
def oblique_light(blur=0.8):
    return light_of(BOARD, OBLIQUE, blur=blur)


def sighted(picture, board=BOARD):
    search = find_board(picture, board)
    assert search.sighting is not None, search.reason
    return search.sighting


def cross(board, uv):
    """Sense of the board's axes in the picture; positive where x × y points away."""
    grid = uv.reshape(board.rows, board.columns, 2)
    a, b = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    return a[0] * b[1] - a[1] * b[0]


@pytest.mark.parametrize(("blur", "noise", "limit"), [(0.8, 0.0, 0.02), (1.5, 1.5, 0.03)])
def test_corners_lie_where_they_were_drawn(blur, noise, limit):
    """(0, 0) is the centre of the upper left pixel: an offset of half a pixel would show."""
    found = sighted(photographed(oblique_light(blur), noise=noise))
    error = found.uv - truth(OBLIQUE, BOARD)
    assert np.sqrt(np.mean(error**2)) < limit
    assert np.abs(error.mean(axis=0)).max() < 0.01


def test_scatter_of_corners_is_their_std():
    """54 corners in 20 pictures of other noise: the scatter has 2052 degrees of freedom, so its
    ratio to the std is known to 1.6 %. The std holds 0.018 px for what is not noise, and the
    slopes that it is made of hold noise themselves, which makes it the more careful."""
    uv, std = [], []
    for seed in range(20):
        found = sighted(photographed(oblique_light(1.5), noise=4.0, seed=seed))
        uv.append(found.uv)
        std.append(found.std)
    scatter = np.sqrt(np.nanvar(uv, axis=0, ddof=1).mean())
    assert 0.7 < scatter / np.sqrt(np.nanmean(np.square(std))) < 1.05


def test_half_the_contrast_doubles_the_std():
    """Of what the noise causes; 0.06 px over the root of the window is there without noise."""
    light = oblique_light(1.5)
    faint = sighted(photographed(0.5 * light, noise=1.5)).std
    strong = sighted(photographed(light, noise=1.5)).std
    floor = 0.06**2 / 11
    ratio = np.sqrt(np.median(faint**2 - floor) / np.median(strong**2 - floor))
    assert ratio == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("roll", [0.0, 0.9, 1.8, 3.0, -1.2])
def test_numbering_follows_the_right_hand_and_the_dark_corner_square(roll):
    """10 × 7 squares: the two ends differ in colour, and the drawing's first square is black."""
    matrix = view(BOARD, tilt=0.3, roll=roll, distance=500.0)
    found = sighted(draw(BOARD, matrix, samples=3))
    assert np.nanmax(np.abs(found.uv - truth(matrix, BOARD))) < 0.2


@pytest.mark.parametrize("size", [(6, 8), (5, 5), (6, 6)])
def test_boards_with_equal_ends_are_numbered_right_handed_from_the_upper_left(size):
    board = replace(BOARD, columns=size[0], rows=size[1])
    matrix = view(board, tilt=0.2, roll=2.9, distance=500.0)
    uv = sighted(draw(board, matrix, samples=3), board).uv
    assert cross(board, uv) > 0
    drawn = truth(matrix, board)
    away = np.linalg.norm(uv[:, None] - drawn, axis=-1)
    assert away.min(axis=1).max() < 0.2
    corners = uv[[0, board.columns - 1, -board.columns, -1]]
    upper = corners.sum(axis=1)
    assert upper[0] == upper.min() or size == (6, 6)


def test_a_mirrored_chessboard_is_numbered_right_handed_too():
    uv = sighted(np.ascontiguousarray(photographed(oblique_light())[:, ::-1])).uv
    assert cross(BOARD, uv) > 0


@pytest.mark.parametrize("kind", ["colour", "16 bit", "8 bit, dim"])
def test_every_kind_of_picture_gives_the_same_corners(kind):
    light = oblique_light()
    picture = {
        "colour": np.stack([photographed(light, seed=s) for s in range(3)], axis=-1),
        "16 bit": (photographed(light).astype(np.uint16) * 60),
        "8 bit, dim": photographed(0.1 * light, noise=0.4),
    }[kind]
    error = sighted(picture).uv - truth(OBLIQUE, BOARD)
    assert np.sqrt(np.nanmean(error**2)) < (0.1 if kind == "8 bit, dim" else 0.03)


def test_a_board_in_a_large_picture_is_found_at_full_accuracy():
    size = (2600, 1950)
    matrix = view(BOARD, focal=3600.0, size=size, distance=700.0, tilt=0.3)
    picture = draw(BOARD, matrix, size=size, samples=2)
    error = sighted(picture).uv - truth(matrix, BOARD)
    assert np.sqrt(np.mean(error**2)) < 0.03


@pytest.mark.parametrize("angle", [1.4, 0.8, 2.6, 1.57, 0.3])
@pytest.mark.parametrize("peak", [80.0, 300.0])
def test_corners_beside_a_laser_line_are_not_believed(angle, peak):
    """The line moves some corners by pixels; what is left is as good as without it."""
    line = ((300.0, 200.0), angle, 2.0, peak)
    v, u = np.indices((480, 640))
    across = -(u - 300.0) * np.sin(angle) + (v - 200.0) * np.cos(angle)
    lit = oblique_light() + peak * np.exp(-0.5 * (across / line[2]) ** 2)
    found = sighted(photographed(lit))
    error = np.linalg.norm(found.uv - truth(OBLIQUE, BOARD), axis=1)
    seen = np.isfinite(error)
    assert 40 <= seen.sum() <= 52
    assert np.sqrt(np.mean(error[seen] ** 2) / 2) < 0.04
    assert error[seen].max() < 0.2
    assert np.array_equal(seen, np.isfinite(found.std))


def test_with_too_few_clear_corners_the_others_stay_with_a_larger_std():
    """A small board, a line down its middle column: only two columns of three are clear."""
    board = PlanarBoard("chessboard", 3, 3, (20.0, 20.0))
    matrix = view(board, distance=300.0)
    u, v = truth(matrix, board)[4]
    picture = draw(board, matrix, laser=((u + 7.0, v), np.pi / 2, 2.0, 120.0), samples=3)
    search = find_board(picture, board)
    assert search.sighting is not None
    std = search.sighting.std.reshape(3, 3)
    assert np.isfinite(std).all()
    assert std[:, 1].min() > 3.0 * std[:, [0, 2]].max()
    assert "laser off" in search.reason


def test_the_lit_picture_of_a_pair_serves_where_the_other_is_black():
    picture = photographed(oblique_light())
    black = np.zeros_like(picture)
    assert find_board(black, BOARD).sighting is None
    assert find_board(black, BOARD, picture).sighting is not None


def reason(picture, board=BOARD):
    search = find_board(picture, board)
    assert search.sighting is None
    return search.reason


def test_a_board_that_runs_out_of_the_picture_is_told():
    picture = draw(BOARD, view(BOARD, tilt=0.2, shift=(80.0, 0.0)), samples=3)
    assert "runs out" in reason(picture)
    assert "charuco" in reason(picture)


@pytest.mark.parametrize("size", [(8, 6), (10, 6), (9, 5), (9, 7), (11, 8), (7, 4)])
def test_the_wrong_size_is_named_beside_the_right_one(size):
    other = replace(BOARD, columns=size[0], rows=size[1])
    text = reason(photographed(oblique_light()), other)
    assert f"{size[0]} × {size[1]}" in text
    assert "9 × 6" in text or "larger" in text


def test_columns_and_rows_may_be_exchanged():
    found = find_board(photographed(oblique_light()), replace(BOARD, columns=6, rows=9)).sighting
    assert found is not None
    assert cross(replace(BOARD, columns=6, rows=9), found.uv) > 0


def test_two_boards_are_refused_with_their_places():
    left, right = (view(BOARD, distance=900.0, shift=(s, 0.0)) for s in (180.0, -180.0))
    under = light_of(BOARD, left, samples=3)
    text = reason(photographed(light_of(BOARD, right, samples=3, under=under)))
    assert "two boards" in text
    assert text.count("(") == 2


def test_a_blurred_picture_is_called_blurred():
    text = reason(photographed(cv2.GaussianBlur(oblique_light(), (0, 0), 9.0)))
    assert "blurred" in text


def test_motion_in_one_direction_is_blur_too():
    picture = photographed(cv2.blur(oblique_light(), (31, 1)))
    assert "blurred" in reason(picture)


def test_a_very_broad_bright_line_leaves_too_little():
    v = np.arange(480.0)[:, None]
    line = 900.0 * np.exp(-0.5 * ((v - 240.0) / 25.0) ** 2)
    assert "the laser" in reason(photographed(oblique_light() + line))


@pytest.mark.parametrize("grain", [1.0, 4.0])
def test_texture_is_no_board(grain):
    texture = np.random.default_rng(1).normal(0.0, 1.0, (480, 640))
    texture = cv2.GaussianBlur(texture, (0, 0), grain)
    picture = photographed(128.0 + 60.0 * texture / texture.std())
    assert "no chessboard of 9 × 6" in reason(picture)


def test_what_is_no_pair_or_no_picture_is_refused():
    picture = photographed(oblique_light())
    with pytest.raises(InputError, match="same camera"):
        find_board(picture, BOARD, picture[:-1])
    with pytest.raises(InputError, match="shape"):
        find_board(np.zeros(5), BOARD)
