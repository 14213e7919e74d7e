"""The floor of speckle, against speckle made of waves.

A fully developed speckle field: random waves through a round pupil, so many independent patterns
summed as the contrast asks for, times a Gaussian line, summed over pixels, and its centres taken.
"""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from sheetoflight.imaging.stripe.speckle import Speckle

WIDE = 48  # px across the line, and so much dark beside it
CENTRE = 24.2
ROWS = 200


def intensity(rng, size, fine):
    """Speckle of mean 1 and contrast 1 on a grid `fine` times as fine as the pixels; the pupil
    passes waves up to 1/(2 size) periods per px: sin u′/λ."""
    y, x = (np.fft.fftfreq(n * fine, 1.0 / fine) for n in (ROWS, WIDE))
    pupil = np.hypot(y[:, None], x) <= 1.0 / (2.0 * size)
    waves = rng.normal(size=(2, *pupil.shape))
    light = np.abs(np.fft.ifft2(np.fft.fft2(waves[0] + 1j * waves[1]) * pupil)) ** 2
    return light / light.mean()


def speckled(rng, size, width, patterns=1):
    """Rows of a vertical line of height 1 ``(ROWS, WIDE)`` under summed speckle patterns."""
    fine = max(4, int(np.ceil(4.0 / size)))
    light = sum(intensity(rng, size, fine) for _ in range(patterns)) / patterns
    x = (np.arange(WIDE * fine) + 0.5) / fine - 0.5
    lit = light * np.exp(-0.5 * ((x - CENTRE) / width) ** 2)
    return lit.reshape(ROWS, fine, WIDE, fine).mean(axis=(1, 3))


def speckle_of(size, contrast=1.0):
    return Speckle(contrast, wavelength_nm=500.0, aperture=2.0 * size, pixel_um=1.0)


def centres(size, width, patterns, pictures, detector="auto"):
    """Errors and profile widths that the detector finds, in 16 bits with little noise."""
    errors, widths = [], []
    for seed in range(pictures):
        rng = np.random.default_rng([4, seed])
        lit = np.pad(speckled(rng, size, width, patterns), ((0, 0), (0, 40)))
        picture = np.rint(3000.0 * lit + 200.0 + rng.normal(0.0, 10.0, lit.shape))
        stripe = extract_stripe(
            np.clip(picture, 0, 65535).astype(np.uint16), options=StripeOptions(detector=detector)
        )
        used = stripe.good & (np.abs(stripe.uv[:, 0] - CENTRE) < 3.0 * width)
        errors.append(stripe.uv[used, 0] - CENTRE)
        widths.append(stripe.width[used])
    return np.concatenate(errors), np.concatenate(widths)


def test_waves_through_a_round_pupil_have_contrast_1_and_the_speckle_size_asked_for():
    """The spectrum ends at the pupil's diameter, 1/size; 200 · 48 px hold 1900 speckles of 2 px."""
    light = intensity(np.random.default_rng(1), 2.0, 4)
    assert light.std() == pytest.approx(1.0, abs=0.1)
    power = np.abs(np.fft.fft(light, axis=1)).mean(axis=0)
    beyond = np.abs(np.fft.fftfreq(WIDE * 4, 0.25)) > 1.02 / 2.0
    assert power[beyond].max() < 1e-6 * power.max()


def test_small_speckle_moves_a_row_s_centre_of_gravity_as_the_integral_says():
    """For speckles far below the pixel the integral over independent coherence areas gives
    π^¼ C √(W/p) λ/(2π sin u′). At 0.2 px p′ is 1.10 p, and 5 % below its root; 600 rows know a
    standard deviation to 3 %: 0.95 ± 4 · 0.03."""
    rng, width = np.random.default_rng(2), 3.0
    found = []
    for _ in range(3):
        rows = speckled(rng, 0.2, width)
        found.append(rows @ (np.arange(WIDE) - CENTRE) / rows.sum(axis=1))
    expected = np.pi**0.25 * np.sqrt(width) * 2.0 * 0.2 / (2.0 * np.pi)
    assert np.std(found) / expected == pytest.approx(0.95, abs=0.12)


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("width", [1.5, 3.0])
def test_the_default_detector_s_centres_scatter_as_stated(size, width):
    """Contrast 0.33 of 9 patterns. 600 rows, of which 1 in 1 + size is independent, know a standard
    deviation to 3.5 to 5 %; the statement is good to 15 %."""
    errors, widths = centres(size, width, patterns=9, pictures=3)
    assert len(errors) > 0.95 * 3 * ROWS
    stated = np.median(speckle_of(size, 1.0 / 3.0).std(widths))
    assert errors.std() / stated == pytest.approx(1.0, abs=0.15 + 2.0 * 0.05)


def test_a_laser_s_full_contrast_still_scatters_as_stated():
    """Contrast 1: rows are torn, and the fit is far from linear."""
    errors, widths = centres(0.7, 2.5, patterns=1, pictures=3)
    stated = np.median(speckle_of(0.7).std(widths))
    assert errors.std() / stated == pytest.approx(1.0, abs=0.25)


def test_at_speckles_of_a_pixel_it_is_the_known_formula():
    """1.1 C √(W/p) λ/(2π sin u′), to its two digits, for a line much wider than a speckle."""
    known = 1.1 * 0.5 * np.sqrt(4.0) * 2.0 * 1.0 / (2.0 * np.pi)
    assert speckle_of(1.0, 0.5).std(np.array([4.0]))[0] == pytest.approx(known, rel=0.04)


def test_it_grows_with_contrast_wavelength_and_aperture_number():
    width = np.array([2.0])
    base = Speckle().std(width)
    assert (Speckle(contrast=0.5).std(width) == 0.5 * base).all()
    assert (Speckle(wavelength_nm=850.0).std(width) > base).all()
    assert (Speckle(aperture=11.0).std(width) > base).all()


@pytest.mark.parametrize("changes", [{"contrast": 1.2}, {"pixel_um": 0.0}, {"aperture": np.nan}])
def test_values_that_cannot_be_are_refused(changes):
    with pytest.raises(InputError):
        Speckle(**changes)
