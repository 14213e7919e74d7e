"""Centres of drawn lines against the bound of their pixels: the small share of
tests/accuracy/test_stripe_accuracy.py, whose tables `python -m bench.stripe_accuracy` prints.

How far a root mean square over n independent errors may lie off by chance: chi-squared's quantiles
at odds of 1e-4 on each side. Centres of steger share their noise over 2 √π scales along the line,
so fewer of them count.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from bench._dark_pictures import DARK_PICTURES
from bench._drawn_stripes import DrawnLine
from bench._stripe_errors import stripe_errors
from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.detectors import DETECTORS
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe

ODDS = 1e-4
SEED = 11

# Pulls stated without chance: 0.9 to 1.1; thinning's whole pixels are no noise at all, and each
# line shows only some of their phases.
PULLS = dict.fromkeys(DETECTORS, (0.9, 1.1)) | {"thin": (0.7, 1.35)}


def limits(count, low=1.0, high=1.0):
    """Between which a root mean square ratio over `count` errors lies, its true value between
    `low` and `high`, but for 1e-4 on each side."""
    spread = np.sqrt(chi2.ppf([ODDS, 1.0 - ODDS], count) / count)
    return low * spread[0], high * spread[1]


def independent(detector, result):
    share = 1.0 / (1.0 + 2.0 * np.sqrt(np.pi) * max(result.line.width, 1.0))
    return len(result.errors) * (share if detector == "steger" else 1.0)


@pytest.mark.parametrize(
    ("width", "amplitude", "noise", "slope"),
    [
        (0.8, 220, 1, 10),
        (0.8, 60, 10, 70),
        (1.5, 100, 3, 25),
        (2.0, 30, 3, 60),
        (4.0, 220, 10, 0),
        (4.0, 50, 10, 80),
    ],
)
def test_the_default_reaches_the_bound_of_the_pixels(width, amplitude, noise, slope):
    """1.10 times the bound; stated uncertainties within 10 %; the mean within 4 of its standard
    errors of 0.005 px (odds 6e-5); 600 to 1000 centres."""
    result = stripe_errors(DrawnLine(width, amplitude, noise, slope), 4, SEED)
    count = len(result.errors)
    assert result.over_bound < limits(count, high=1.10)[1]
    low, high = limits(count, 0.9, 1.1)
    assert low < result.pull < high
    assert abs(result.bias) < 0.005 + 4.0 * result.bias_std
    assert result.false == 0


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize(("width", "slope"), [(1.0, 12), (2.0, 25)])
def test_every_detector_states_its_errors(detector, width, slope):
    """At peak/noise 50, where all of them are what they say."""
    options = StripeOptions(detector=detector)
    result = stripe_errors(DrawnLine(width, 200, 4, slope), 4, SEED, options)
    assert result.detector == detector
    low, high = limits(independent(detector, result), *PULLS[detector])
    assert low < result.pull < high
    if detector != "thin":
        assert abs(result.bias) < 0.005 + 4.0 * np.sqrt(result.bias_std**2 * 8.0)


@pytest.mark.parametrize("width", [0.8, 1.0, 2.0, 4.0])
def test_without_noise_no_phase_is_biased(width):
    """Twelve phases along the rows, the light integrated over each pixel by another formula."""
    result = stripe_errors(DrawnLine(width, 200, 0.0), 12, SEED)
    assert len(result.by_phase) == 12
    assert np.abs(result.by_phase).max() < 0.005
    assert np.abs(result.errors).max() < 0.005


@pytest.mark.parametrize("width", [0.8, 2.0])
@pytest.mark.parametrize("share", [0.2, 0.4])
def test_saturated_lines_keep_their_centre(width, share):
    """0.05 px; the noise's own part is 0.02 at the most."""
    result = stripe_errors(DrawnLine(width, 1.0, 2.0, 15).clipped(share), 3, SEED)
    assert result.rms < 0.05
    assert abs(result.bias) < 0.005 + 4.0 * result.bias_std
    assert result.found > 0.97


@pytest.mark.parametrize("width", [0.8, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("slope", [7, 70])
def test_a_faint_line_is_found_from_border_to_border(width, slope):
    """Peak/noise 5: 99 % of 600 to 800 rows or columns, but for 3 standard deviations."""
    result = stripe_errors(DrawnLine(width, 50, 10, slope, (300, 400)), 2, SEED)
    expected = len(result.errors) / result.found
    assert result.found > 0.99 - 3.0 * np.sqrt(0.99 * 0.01 / expected)
    assert result.false == 0


@pytest.mark.parametrize("kind", DARK_PICTURES)
def test_there_is_no_line_where_there_is_none(kind):
    """Six pictures of each of the eleven kinds; of a true share of 1 in 100 one would be seen with
    odds of a half."""
    for index in range(6):
        stripe = extract_stripe(DARK_PICTURES[kind](np.random.default_rng([SEED, index])))
        assert len(stripe) == 0
        assert stripe.lines == 0


def test_the_choice_of_detector_is_told_and_can_be_made_by_hand():
    picture = DrawnLine(1.5, 100, 3, 15).recorded(np.random.default_rng(SEED))
    assert "bound of each row" in extract_stripe(picture).reason
    chosen = extract_stripe(picture, options=StripeOptions(detector="fir"))
    assert (chosen.detector, chosen.reason) == ("fir", "asked for")
    with pytest.raises(InputError):
        StripeOptions(detector="best")
