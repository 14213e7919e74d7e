"""Centres against the Cramér–Rao bound, and against the profile's exact integral."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from sheetoflight.imaging.stripe.centres import Track
from sheetoflight.imaging.stripe.gaussian import fitted_centres
from sheetoflight.imaging.stripe.light import line_light
from sheetoflight.imaging.stripe.noise import UNKNOWN_NOISE


def profile(centres, width, amplitude):
    """Rows of a vertical line, integrated over each pixel exactly."""
    x = np.arange(41.0)
    right, left = (x + 0.5 - centres[:, None]) / width, (x - 0.5 - centres[:, None]) / width
    return amplitude * width * np.sqrt(2.0 * np.pi) * (ndtr(right) - ndtr(left))


def track_of(rows, width):
    return Track(
        along=np.arange(rows),
        across=np.full(rows, 20.3),
        by_rows=True,
        slope=np.zeros(rows),
        width=np.full(rows, width),
        amplitude=np.ones(rows),
        law=UNKNOWN_NOISE,
    )


@pytest.mark.parametrize("width", [0.8, 1.0, 2.0, 4.0])
def test_centres_reach_the_bound(width):
    """600 rows: a standard deviation is known to 3 %, the mean to 1/25 of it. Amplitude 200,
    noise 2: method.md gives 1.00 to 1.08 times the bound 1.062 √w σ/A for this estimator."""
    rng = np.random.default_rng(7)
    centres = 20.0 + rng.uniform(-0.5, 0.5, 600)
    picture = profile(centres, width, 200.0) + rng.normal(0.0, 2.0, (600, 41))
    off = np.zeros_like(picture)
    fit = fitted_centres(line_light(picture, off), track_of(600, width))
    assert fit.good.all()
    errors = fit.uv[:, 0] - centres
    bound = 1.062 * np.sqrt(width) * 2.0 / 200.0
    assert errors.std() < 1.2 * bound
    assert abs(errors.mean()) < 4.5 * bound / np.sqrt(600)
    assert np.sqrt(np.mean((errors / fit.std) ** 2)) == pytest.approx(1.0, abs=0.13)


def test_exact_profiles_give_the_exact_centre_width_and_height():
    centres = np.linspace(19.5, 20.5, 21)
    picture = profile(centres, 1.3, 150.0)
    fit = fitted_centres(line_light(picture, np.zeros_like(picture)), track_of(21, 1.0))
    assert np.allclose(fit.uv[:, 0], centres, atol=1e-3)
    assert np.allclose(fit.width, 1.3, atol=1e-3)
    assert np.allclose(fit.amplitude, 150.0, atol=0.1)


def test_full_samples_bound_the_light_from_below():
    centres = np.full(40, 20.2)
    rng = np.random.default_rng(8)
    clipped = np.clip(np.rint(profile(centres, 2.0, 700.0) + rng.normal(0, 2, (40, 41))), 0, 255)
    light = line_light(clipped.astype(np.uint8))
    assert light.full.any()
    fit = fitted_centres(light, track_of(40, 2.0))
    assert np.abs(fit.uv[:, 0] - 20.2).max() < 0.05


def test_a_row_without_light_is_not_good():
    rng = np.random.default_rng(9)
    picture = rng.normal(0.0, 2.0, (60, 41))
    fit = fitted_centres(line_light(picture, np.zeros_like(picture)), track_of(60, 1.0))
    significant = fit.good & (fit.amplitude > 6.0 * np.maximum(fit.amplitude_std, 2.0))
    assert not significant.any()
