"""One channel that shows the line: noise, full pixels, colours."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.stripe.light import line_light


@pytest.mark.parametrize("std", [1.0, 3.0, 10.0])
def test_the_noise_is_estimated_whatever_the_slope_of_the_background(std):
    """120 000 samples with a mask of 9: the estimate is good to 1 % (one standard deviation)."""
    rng = np.random.default_rng(1)
    ramp = np.indices((300, 400)).sum(axis=0) / 5.0
    picture = np.rint(ramp + 60.0 + rng.normal(0.0, std, ramp.shape)).astype(np.uint16)
    assert line_light(picture).noise_std == pytest.approx(np.hypot(std, 0.29), rel=0.05)


def test_a_difference_has_the_noise_of_both():
    rng = np.random.default_rng(2)
    on, off = (np.rint(60 + rng.normal(0, 3, (300, 400))).astype(np.uint8) for _ in range(2))
    assert line_light(on, off).noise_std == pytest.approx(3.0 * np.sqrt(2.0), rel=0.05)


def test_a_noise_free_picture_still_has_the_noise_of_rounding():
    flat = np.full((50, 50), 7, np.uint8)
    assert line_light(flat, flat).noise_std == pytest.approx(np.sqrt(2.0 / 12.0))


def test_whole_numbers_are_subtracted_without_wrapping():
    on, off = np.full((20, 20), 5, np.uint8), np.full((20, 20), 9, np.uint8)
    assert (line_light(on, off).picture == -4.0).all()


def test_a_stop_below_the_type_s_limit_counts_as_full():
    """A camera of 12 bits in a picture of 16."""
    rng = np.random.default_rng(3)
    picture = rng.integers(100, 200, (40, 40)).astype(np.uint16)
    picture[10:14, 10:14] = 4095
    full = line_light(picture).full
    assert full.sum() == 16
    assert full[10:14, 10:14].all()


def test_no_pixel_of_a_blank_picture_is_full():
    assert not line_light(np.full((30, 30), 255, np.uint8)).full.any()


def test_the_channel_follows_the_line_s_colour():
    picture = np.full((64, 64, 3), 40, np.uint8)
    picture[:, 30:33] = [40, 200, 40]
    light = line_light(picture, np.full((64, 64, 3), 40, np.uint8))
    assert np.allclose(light.picture[:, 31], 160.0)
    assert np.allclose(light.picture[:, 5], 0.0)
