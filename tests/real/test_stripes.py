"""The laser's line in other people's photographs: found where it is, and nowhere else.

Nothing is set by hand. Each judge is a few lines of its own and shares no code with the extraction.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import median_filter

from sheetoflight.imaging.stripe.extraction import extract_stripe
from tests.real.straight_lines import coloured_columns, straight_lines

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "shared" / "real"
CICLOP = PHOTOGRAPHS / "ciclop_3dscanscience"
BENT = sorted((PHOTOGRAPHS / "hjamal_green").glob("*.jpg"))
SATURATED = sorted((PHOTOGRAPHS / "etna_robot").glob("*/frame*.png"))[::2]
DESKTOP = sorted((PHOTOGRAPHS / "srv_desktop" / "laser").glob("*.jpg"))
EVERY = 12

pytestmark = pytest.mark.skipif(
    not PHOTOGRAPHS.is_dir(),
    reason=f"the photographs are not here: no folder {Path('..') / 'shared' / 'real'}",
)


def photograph(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture


def lines_of(stripe):
    return [stripe.uv[stripe.line == number] for number in range(stripe.lines)]


def covered(rows, uv):
    """Which of some rows hold a centre."""
    return np.isin(rows, np.unique(np.rint(uv[:, 1]).astype(int)))


def beside(uv, line):
    slope, level, _, _ = line
    return np.abs(uv[:, 0] - slope * uv[:, 1] - level)


@pytest.mark.parametrize("path", BENT, ids=[path.stem for path in BENT])
def test_a_green_line_on_a_bent_board_is_followed_to_the_lower_border(path: Path):
    """The judge is the greenest column of each row, where it agrees with its neighbours' and is
    not much fainter. Where it jumps, the line leaves the board for the wall behind it."""
    picture = photograph(path).astype(float)
    green = picture[..., 1] - picture[..., [0, 2]].mean(axis=2)
    narrow, broad = (cv2.GaussianBlur(green, (0, 0), sigmaX=s, sigmaY=2.0) for s in (2.0, 10.0))
    answer = narrow - broad
    column, height = np.argmax(answer, axis=1), answer.max(axis=1)
    agree = np.abs(column - median_filter(column, 31)) < 3
    rows = np.flatnonzero(agree & (height > 0.3 * np.median(height[agree])))
    jump = np.abs(np.diff(column[rows])) > 8
    rows = max(np.split(rows, np.flatnonzero(jump | (np.diff(rows) > 20)) + 1), key=len)
    top = rows[0]
    assert len(rows) > 250
    uv = extract_stripe(photograph(path)).uv
    assert covered(rows, uv).mean() > 0.95
    assert uv[:, 1].max() > len(agree) - 4
    below = uv[uv[:, 1] >= top]
    aside = np.abs(below[:, 0] - column[np.rint(below[:, 1]).astype(int)])
    assert np.median(aside) < 1.0
    assert np.mean(aside < 4.0) > 0.97


@pytest.mark.parametrize("path", SATURATED, ids=[f"{p.parent.name}-{p.stem}" for p in SATURATED])
def test_a_saturated_stripe_is_found_and_its_reflections_are_not(path: Path):
    """The judge is the middle of the only run of 6 to 30 full pixels in a row."""
    picture = photograph(path)
    rows, middles = [], []
    for row, full in enumerate(picture[..., 0] >= 250):
        columns = np.flatnonzero(full)
        if 6 <= columns.size <= 30 and np.ptp(columns) < 1.3 * columns.size:
            rows.append(row)
            middles.append(columns.mean())
    assert len(rows) > 200
    stripe = extract_stripe(picture)
    assert covered(np.array(rows), stripe.uv).mean() > 0.97
    errors = []
    for uv in lines_of(stripe):
        near = covered(np.rint(uv[:, 1]), np.stack([middles, rows], axis=-1))
        if near.mean() < 0.5:
            continue  # rows in which the sensor was not full
        aside = uv[near, 0] - np.interp(uv[near, 1], rows, middles)
        errors.append(aside)
        assert np.median(np.abs(aside)) < 3.0
    assert np.median(np.abs(np.concatenate(errors))) < 1.0


def test_the_red_line_on_a_bust_has_three_parts():
    """The judge is the smooth difference of the red channels: three parts brighter than 20."""
    on = photograph(CICLOP / "laser_object" / "laser.png")
    off = photograph(CICLOP / "laser_object" / "laser_background.png")
    red = cv2.GaussianBlur(on[..., 2].astype(float) - off[..., 2], (0, 0), 1.0)
    _, label, statistics, _ = cv2.connectedComponentsWithStats((red > 20.0).astype(np.uint8))
    parts = [k for k in range(1, len(statistics)) if statistics[k, cv2.CC_STAT_AREA] > 200]
    assert len(parts) == 3
    uv = extract_stripe(on, off).uv
    columns, rows = np.rint(uv).astype(int).T
    assert np.mean(np.isin(label[rows.clip(0, len(red) - 1), columns], parts)) > 0.99
    for part in parts:
        lit = np.flatnonzero(((label == part) & (red > 30.0)).any(axis=1))
        assert covered(lit, uv).mean() > 0.9


@pytest.mark.parametrize("name", ["", "-x"])
@pytest.mark.parametrize("alone", [False, True], ids=["pair", "single"])
def test_two_red_lines_on_a_pattern_and_no_other(name: str, alone: bool):
    """The judge is straight lines in the difference of the red channels. Below the board the
    turntable's rim throws some of the light back: at most one line is found there."""
    on = photograph(CICLOP / "laser_pattern" / f"laser-0-255-255-8{name}.png")
    off = photograph(CICLOP / "laser_pattern" / f"laser-background-0-255-255-8{name}.png")
    difference = np.zeros(on.shape)
    difference[..., 2] = on[..., 2].astype(float) - off[..., 2]
    judged = straight_lines(*coloured_columns(difference, 2), np.random.default_rng(0))
    assert len(judged) == 2
    stripe = extract_stripe(on) if alone else extract_stripe(on, off)
    lines = lines_of(stripe)
    for line in judged:
        of_line = np.concatenate([uv for uv in lines if np.median(beside(uv, line)) < 2.0])
        assert covered(np.arange(line[2], line[3] + 1), of_line).mean() > 0.8
    others = [uv for uv in lines if min(np.median(beside(uv, line)) for line in judged) > 3.0]
    assert len(others) <= (0 if alone else 1)
    assert all(uv[:, 1].min() > max(line[3] for line in judged) for uv in others)


def test_green_lines_on_a_hand_held_board_are_found_without_settings():
    """Every twelfth photograph. The judge is the longest straight line of green pixels: on the
    board, or on what is behind it. Over nine tenths of the rows of five in six are shown."""
    shown, found = 0, 0
    for path in DESKTOP[::EVERY]:
        picture = photograph(path)
        judged = straight_lines(*coloured_columns(picture, 1), np.random.default_rng(0))
        if not judged:
            continue
        line = max(judged, key=lambda one: one[3] - one[2])
        uv = extract_stripe(picture).uv
        near = uv[beside(uv, line) < 1.5]
        shown += 1
        found += bool(covered(np.arange(line[2], line[3] + 1), near).mean() > 0.9)
    assert shown >= 10
    assert found >= 5 * shown / 6
