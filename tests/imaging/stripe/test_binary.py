"""The binary picture of the line."""

from __future__ import annotations

import numpy as np

from sheetoflight.imaging.stripe.binary import binary_line
from tests.imaging.stripe.drawn_lines import Strip, drawn, recorded

STRIP = Strip((40.0, 30.0), (150.0, 180.0), sheet=1.5)


def test_pixels_of_the_line_are_set_and_no_others():
    rng = np.random.default_rng(1)
    light = drawn((220, 220), STRIP)
    lit = binary_line(recorded(light, rng), recorded(0.0 * light, rng))
    assert lit.dtype == bool
    assert lit[light > 60.0].all()
    assert not lit[light < 6.0].any()


def test_it_is_as_long_as_the_line():
    """Each column the line crosses is set, give or take the blur at its ends."""
    rng = np.random.default_rng(2)
    light = drawn((220, 220), STRIP)
    rows = np.flatnonzero(binary_line(recorded(light, rng), recorded(0.0 * light, rng)).any(axis=1))
    assert abs(rows[0] - 30) <= 3
    assert abs(rows[-1] - 180) <= 3
    assert np.array_equal(rows, np.arange(rows[0], rows[-1] + 1))


def test_one_picture_alone_is_taken_against_its_surroundings():
    rng = np.random.default_rng(3)
    uneven = np.indices((220, 220))[1] / 4.0
    lit = binary_line(recorded(drawn((220, 220), STRIP) + uneven, rng))
    light = drawn((220, 220), STRIP)
    assert lit[light > 60.0].all()
    assert not lit[light < 3.0].any()


def test_noise_leaves_it_empty():
    rng = np.random.default_rng(4)
    assert not binary_line(recorded(np.zeros((300, 300)), rng)).any()
    assert not binary_line(np.zeros((1, 1), np.uint8)).any()
