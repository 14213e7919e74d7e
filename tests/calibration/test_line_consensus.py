"""Where on a line the board ends, and which pieces lie in one sheet."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.calibration.line_consensus import FacePlanes, agreed_pieces
from sheetoflight.calibration.straight_pieces import Piece, grown

NOISE_PX = 0.2


def line(heights: np.ndarray, seed: int = 3) -> np.ndarray:
    """Points a pixel apart along x, at these heights and with noise."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE_PX, len(heights))
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    return np.column_stack([np.arange(len(heights)), heights + noise]) @ turn.T


def among(count: int, low: int, high: int) -> np.ndarray:
    """Mask of the points from ``low`` up to ``high``."""
    places = np.arange(count)
    return (places >= low) & (places < high)


def test_a_short_part_on_the_pattern_tells_a_long_line_on_the_margin() -> None:
    """Beyond 5.9 standard deviations a point in a thousand million is missed by chance."""
    own = grown(line(np.zeros(1000)), among(1000, 400, 460))
    assert own.mean() > 0.99


@pytest.mark.parametrize("width", [1, 30, 100])
def test_a_gap_is_no_end(width: int) -> None:
    """A dark field of the pattern, or a scratch, that is narrower than what is known so far."""
    points = line(np.zeros(1000))
    points[among(1000, 600, 600 + width)] = np.nan
    own = grown(points, among(1000, 300, 500))
    assert own[among(1000, 600 + width, 1000)].mean() > 0.99
    assert not own[among(1000, 600, 600 + width)].any()


def test_what_goes_on_far_away_is_something_else() -> None:
    points = line(np.zeros(1000))
    points[among(1000, 400, 800)] = np.nan
    own = grown(points, among(1000, 300, 400))
    assert not own[800:].any()


@pytest.mark.parametrize("step", [-4.0, 3.0, 20.0])
def test_a_line_ends_at_a_step(step: float) -> None:
    """What lies lower than the board is seen beside the line, by the sheet's slant."""
    own = grown(line(np.where(among(1000, 700, 1000), step, 0.0)), among(1000, 300, 500))
    assert own[:700].mean() > 0.99
    assert not own[701:].any()


def test_a_line_ends_where_it_bends() -> None:
    """On a wall behind the table: up to where the bend is as large as the tolerance of 2 px, and
    the half of a stretch behind it."""
    bent = 0.2 * np.maximum(np.arange(1000) - 700.0, 0.0)
    own = grown(line(bent), among(1000, 300, 500))
    assert own[:690].mean() > 0.98
    assert not own[720:].any()


SHEET_NORMAL, SHEET_MM = np.array([0.8, 0.1, 0.6]) / np.sqrt(1.01), 300.0
FOCAL_PX = 2000.0
FACES = FacePlanes(
    np.array([[0.1, 0.2, 1.0], [-0.2, 0.1, 1.0], [0.3, -0.3, 1.0], [0.0, 0.4, 1.0]]),
    np.array([500.0, 600.0, 550.0, 650.0]),
)


def piece(face: int, weight: float, off_px: float = 0.0) -> Piece:
    """The line in which the sheet meets a face, so far off in the image."""
    rows = np.stack([SHEET_NORMAL, FACES.normal[face], [0.0, 1.0, 0.0]])
    ends = np.linalg.solve(rows, np.array([[SHEET_MM, FACES.offset[face], y] for y in (-80, 80)]).T)
    xy = (ends[:2] / ends[2]).T
    along = xy[1] - xy[0]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    return Piece(np.arange(20), xy + off_px / FOCAL_PX * across, weight)


def chosen(*weights: float, off_px: float = 0.0) -> list[int | None]:
    """What is chosen of pieces of these weights on the faces, the last of them off the sheet."""
    last = len(weights) - 1
    lines = [[piece(k, w, off_px if k == last else 0.0)] for k, w in enumerate(weights)]
    return agreed_pieces(lines, FACES, FOCAL_PX, len(lines))


def test_a_piece_without_a_say_may_lie_in_the_others_sheet() -> None:
    assert chosen(20.0, 20.0, 20.0, 0.0) == [0, 0, 0, 0]
    assert chosen(20.0, 20.0, 20.0, 0.0, off_px=20.0) == [0, 0, 0, None]


def test_pieces_without_a_say_make_no_sheet() -> None:
    assert chosen(0.0, 0.0, 0.0, 0.0) == [None] * 4
    assert chosen(20.0, 20.0, 0.0, 0.0) == [None] * 4, "any two agree"


def test_light_goes_before_a_piece_without_a_say() -> None:
    """Though an edge beside it lies nearer to the sheet, and though it is the only line."""
    lines = [[piece(k, 0.0), piece(k, 20.0, off_px=0.3 * (k == 2))] for k in range(4)]
    assert agreed_pieces(lines, FACES, FOCAL_PX, 4) == [1, 1, 1, 1]
    assert agreed_pieces([*lines[:1], [], [], []], FACES, FOCAL_PX, 4) == [1, None, None, None]


@pytest.mark.parametrize("views", [4, 40])
def test_views_without_a_line_do_not_outvote_lines_that_all_agree(views: int) -> None:
    lines = [[piece(k, 20.0)] for k in range(4)]
    assert agreed_pieces(lines, FACES, FOCAL_PX, views) == [0, 0, 0, 0]
