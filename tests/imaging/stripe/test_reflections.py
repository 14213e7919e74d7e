"""What is told from the laser's line: reflections, strips of colour, noise of bright things."""

from __future__ import annotations

import numpy as np

from sheetoflight.imaging.stripe.brightness import least_by_brightness
from sheetoflight.imaging.stripe.colour import laser_light
from sheetoflight.imaging.stripe.extraction import extract_stripe
from sheetoflight.imaging.stripe.light import line_light
from sheetoflight.imaging.stripe.ridges import Ridges

SHAPE = (400, 300)
V, U = np.indices(SHAPE, dtype=float)


def bar(u, first, last, width, height):
    """A vertical bar with soft ends."""
    inside = np.clip(V - first + 0.5, 0.0, 1.0) * np.clip(last - V + 0.5, 0.0, 1.0)
    return height * np.exp(-0.5 * ((U - u) / width) ** 2) * inside


def recorded(light, rng, std=2.0):
    return np.clip(np.rint(light + rng.normal(0.0, std, light.shape)), 0, 255).astype(np.uint8)


def columns(stripe):
    """Mean column of each line, sorted."""
    return sorted(float(stripe.uv[stripe.line == k, 0].mean()) for k in range(stripe.lines))


def test_a_short_faint_line_beside_a_long_one_is_a_reflection():
    rng = np.random.default_rng(1)
    picture = recorded(20.0 + bar(100, 0, 399, 2.0, 160.0) + bar(200, 150, 210, 3.0, 60.0), rng)
    assert np.allclose(columns(extract_stripe(picture)), [100.0], atol=0.1)


def test_a_second_laser_is_none():
    """As long as the first though fainter; or short and like the first."""
    rng = np.random.default_rng(2)
    for second in (bar(200, 0, 399, 2.0, 60.0), bar(200, 150, 210, 2.0, 150.0)):
        picture = recorded(20.0 + bar(100, 0, 399, 2.0, 160.0) + second, rng)
        assert np.allclose(columns(extract_stripe(picture)), [100.0, 200.0], atol=0.1)


def test_a_faint_piece_of_a_broken_line_is_none():
    """The line jumps aside to a dark object and back: no row shows it twice."""
    rng = np.random.default_rng(3)
    ends = bar(100, 0, 149, 2.0, 160.0) + bar(100, 211, 399, 2.0, 160.0)
    picture = recorded(20.0 + ends + bar(200, 150, 210, 2.0, 60.0), rng)
    assert columns(extract_stripe(picture))[-1] > 190.0


def test_a_faint_piece_of_a_second_line_on_a_dark_square_is_none():
    """The second of two equal lines crosses a dark square beside the first."""
    rng = np.random.default_rng(4)
    parts = ((0, 99, 150.0), (104, 146, 55.0), (151, 399, 150.0))
    second = sum(bar(200, first, last, 2.0, height) for first, last, height in parts)
    stripe = extract_stripe(recorded(20.0 + bar(100, 0, 399, 2.0, 160.0) + second, rng))
    rows = stripe.uv[stripe.uv[:, 0] > 150.0, 1]
    assert np.mean((rows > 104) & (rows < 146)) > 0.08


def test_the_laser_is_the_thin_line_not_the_bright_strip():
    """A faint green line on a white board, beside a bright strip of red wood: reflected light is
    brighter and wider. Channels are blue, green, red."""
    rng = np.random.default_rng(5)
    board = np.where(U < 150, 170.0, 40.0)[..., None] * np.ones(3)
    line = bar(80, 0, 399, 1.5, 1.0)[..., None] * [25.0, 60.0, 25.0]
    strip = bar(220, 0, 330, 5.0, 1.0)[..., None] * [5.0, 20.0, 110.0]
    picture = recorded(board + line + strip, rng, std=1.5)
    assert laser_light(picture).channel == 1
    assert np.allclose(columns(extract_stripe(picture)), [80.0], atol=0.1)


def test_a_grey_picture_stored_in_colour_has_no_colour():
    rng = np.random.default_rng(6)
    grey = recorded(20.0 + bar(100, 0, 399, 2.0, 160.0), rng)
    assert laser_light(np.repeat(grey[..., None], 3, axis=2)).channel is None


def test_a_line_on_a_bright_background_must_be_as_much_clearer_as_it_is_noisier():
    """Noise of 2 on the dark part, of 8 on the bright: lines there must be four times as strong.
    Each level's noise rests on some 10^4 samples, of which a quarter is independent: 2 %."""
    rng = np.random.default_rng(7)
    off = np.where(U > 150, 180.0, 10.0)
    on = off + np.where(U > 150, 8.0, 2.0) * rng.normal(0.0, 1.0, SHAPE)
    light = line_light(on, off)
    pixels = np.array([[50, 200], [250, 200]])
    one = np.ones(2)
    found = Ridges(pixels, pixels.astype(float), np.eye(2), one, one, scale=2.0)
    dark, bright = least_by_brightness(light, found)
    assert np.isclose(bright / dark, 4.0, rtol=0.1)
    assert not least_by_brightness(line_light(on), found).any()
