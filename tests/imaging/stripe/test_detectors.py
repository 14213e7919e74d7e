"""Laws that every detector keeps, and each one's own mathematics against an independent oracle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import label

from sheetoflight.imaging.stripe.centres import Track
from sheetoflight.imaging.stripe.detectors import DETECTORS
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from sheetoflight.imaging.stripe.light import line_light
from sheetoflight.imaging.stripe.noise import NoiseLaw
from sheetoflight.imaging.stripe.steger import smooth_derivatives
from sheetoflight.imaging.stripe.thin import thinned
from tests.imaging.stripe.drawn_lines import Strip, drawn, recorded

SHAPE = (120, 150)
WHOLE_PIXELS = {"thin"}


def line(width=1.5, slope=0.13, amplitude=150.0):
    """Light of a line ``v = 55.3 + slope u`` that crosses the whole picture."""
    v, u = np.indices(SHAPE)
    distance = (v - 55.3 - slope * u) / np.sqrt(1.0 + slope**2)
    return amplitude * np.exp(-0.5 * (distance / width) ** 2)


def distances(uv, slope=0.13):
    return (uv[:, 1] - 55.3 - slope * uv[:, 0]) / np.sqrt(1.0 + slope**2)


def found(picture, detector):
    stripe = extract_stripe(picture, options=StripeOptions(detector=detector))
    return stripe.taken(stripe.good)


@pytest.mark.parametrize("detector", DETECTORS)
def test_a_clear_line_is_found_where_it_is(detector):
    """Rounding to grey levels leaves 0.003 px; whole pixels 0.29 px and their even-width bias."""
    stripe = found(np.rint(20.0 + line()).astype(np.uint8), detector)
    assert len(stripe) > 130
    limit = 0.7 if detector in WHOLE_PIXELS else 0.03
    assert np.abs(distances(stripe.uv)).max() < limit


@pytest.mark.parametrize("detector", DETECTORS)
def test_a_picture_turned_over_gives_the_centres_turned_over(detector):
    picture = recorded(line(), np.random.default_rng(50))
    straight, turned = found(picture, detector), found(picture.T.copy(), detector)
    assert len(straight) == len(turned)
    if detector not in WHOLE_PIXELS:  # thinning keeps the upper left of two middle pixels
        assert np.allclose(straight.uv, turned.uv[:, ::-1], atol=2e-3)
        assert np.allclose(straight.std, turned.std, rtol=0.02)


@pytest.mark.parametrize("detector", DETECTORS)
def test_more_light_everywhere_changes_nothing(detector):
    rng = np.random.default_rng(51)
    picture = 30.0 + line() + rng.normal(0.0, 2.0, SHAPE)
    one, other = found(picture, detector), found(3.0 * picture + 100.0, detector)
    assert np.allclose(one.uv, other.uv, atol=2e-3)
    assert np.allclose(one.std, other.std, rtol=0.02)
    assert np.allclose(3.0 * one.peak, other.peak, rtol=0.02)


@pytest.mark.parametrize("detector", sorted(set(DETECTORS) - WHOLE_PIXELS))
def test_twice_the_noise_is_twice_the_uncertainty(detector):
    """Light 150, noise 2 and 4: both far above rounding and any error of the phase at this width;
    each median is known to a few per cent."""
    rng = np.random.default_rng(52)
    noise = rng.normal(0.0, 1.0, SHAPE)
    quiet, loud = (found(30.0 + line(2.0) + s * noise, detector) for s in (2.0, 4.0))
    assert np.median(loud.std) / np.median(quiet.std) == pytest.approx(2.0, rel=0.15)


def track_of(centres, width, amplitude):
    """A steep line with a centre known for every row."""
    rows = len(centres)
    return Track(
        along=np.arange(rows),
        across=np.asarray(centres, dtype=float),
        by_rows=True,
        slope=np.zeros(rows),
        width=np.full(rows, width),
        amplitude=np.full(rows, amplitude),
        law=NoiseLaw(1.0, 0.0),
    )


def test_a_sampled_gaussian_is_an_exact_parabola():
    """Without noise and without the pixels' integration its logarithm is a parabola."""
    centres = np.linspace(24.6, 25.4, 40)
    x = np.arange(50.0)
    picture = 1000.0 * np.exp(-0.5 * ((x - centres[:, None]) / 2.0) ** 2)
    light = line_light(picture, np.zeros_like(picture))
    located = DETECTORS["parabola"].centres(light, track_of(centres + 0.2, 2.0, 1000.0))
    assert located.good.all()
    assert np.abs(located.uv[:, 0] - centres).max() < 1e-3


def test_the_centroid_needs_symmetry_alone():
    """A triangular profile, as no Gaussian is: pixel means by exact integration."""
    centres = np.linspace(24.5, 25.5, 60)
    fine = np.arange(0, 50, 0.01) + 0.005 - 0.5
    profile = np.maximum(1.0 - np.abs(fine - centres[:, None]) / 4.0, 0.0)
    picture = 500.0 * profile.reshape(60, 50, 100).mean(axis=2)
    light = line_light(picture, np.zeros_like(picture))
    located = DETECTORS["centroid"].centres(light, track_of(centres, 4.0 / np.sqrt(6.0), 500.0))
    assert np.abs(located.uv[:, 0] - centres).max() < 0.02


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_derivatives_of_a_quadric_are_exact(scale):
    """Smoothing a quadric changes its level alone, so gradient and Hessian are known."""
    v, u = np.indices((60, 60)) - 30.0
    picture = (5.0 + 2.0 * u - 3.0 * v + 0.5 * u * u + 0.3 * u * v - 0.2 * v * v).astype(np.float32)
    uv = np.array([[30.0, 30.0], [31.4, 28.7], [28.2, 33.9]])
    gradient, hessian = smooth_derivatives(picture, uv, scale)
    x, y = (uv - 30.0).T
    assert np.allclose(gradient[:, 0], 2.0 + x + 0.3 * y, atol=0.01)
    assert np.allclose(gradient[:, 1], -3.0 + 0.3 * x - 0.4 * y, atol=0.01)
    assert np.allclose(hessian, [[1.0, 0.3, -0.4]] * 3, atol=0.01)


def test_a_ring_is_followed_all_round():
    """A curve of radius r and width w, smoothed by s, moves outwards by about s²/2r at most."""
    v, u = np.indices((200, 200))
    radius = np.hypot(u - 99.6, v - 100.2)
    ring = np.rint(20 + 180 * np.exp(-0.5 * ((radius - 60.0) / 1.5) ** 2)).astype(np.uint8)
    stripe = found(ring, "steger")
    angle = np.arctan2(stripe.uv[:, 1] - 100.2, stripe.uv[:, 0] - 99.6)
    assert np.histogram(angle, 24, (-np.pi, np.pi))[0].min() > 5
    error = np.hypot(*(stripe.uv - [99.6, 100.2]).T) - 60.0
    assert np.abs(error).max() < 1.5**2 / 60.0 + 0.01


@pytest.mark.parametrize("beside", [20.0, 40.0, 60.0])
def test_a_bar_brighter_on_one_side_is_not_pulled_there(beside):
    """A bar of half width 2.6 px, 150 high, with one side at `beside`: smoothed as the Gaussian
    that fits it, the ridge moves by −(σ²/2w) ln(1 − a), up to 0.34 px; four fifths must be gone."""
    u = np.indices((120, 90))[1]
    bar = 150.0 * np.clip(2.6 + 0.5 - np.abs(u - 45.3), 0.0, 1.0)
    side = beside * np.clip(u - 45.3 - 2.6 + 0.5, 0.0, 1.0)
    picture = np.rint(20.0 + bar + side + np.random.default_rng(53).normal(0, 1, u.shape))
    stripe = found(picture.astype(np.uint8), "steger")
    scale = 2.6 / 1.4
    pull = -(scale**2) / (2.0 * 2.6) * np.log(1.0 - beside / 150.0)
    assert abs(np.median(stripe.uv[:, 0]) - 45.3) < max(0.2 * pull, 0.02)


def pieces(binary):
    """How many parts hang together, corners included."""
    numbers = np.empty(binary.shape, dtype=np.int64)
    label(binary, np.ones((3, 3)), output=numbers)
    return numbers.max()


@pytest.mark.parametrize("seed", range(5))
def test_thinning_keeps_what_hangs_together_and_nothing_new(seed):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(20.0, 140.0, (3, 2, 2))
    strips = [Strip(tuple(a), tuple(b), sheet=2.5) for a, b in ends]
    lit = drawn((160, 160), *strips) > 50.0
    skeleton = thinned(lit)
    assert not (skeleton & ~lit).any()
    assert pieces(skeleton) == pieces(lit)
    assert np.array_equal(thinned(skeleton), skeleton)
    assert skeleton.sum() < 0.35 * lit.sum()
