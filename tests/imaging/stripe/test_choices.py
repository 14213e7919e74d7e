"""Where to look, which of several lines, which colour: what users ask for, and what is found."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from sheetoflight.imaging.stripe.speckle import Speckle
from tests.imaging.stripe.drawn_lines import Strip, drawn, recorded

SHAPE = (160, 220)


def row(v, amplitude=120.0, first=-20.0, last=240.0):
    return Strip((first, v), (last, v + 6.0), amplitude=amplitude)


@pytest.fixture(scope="module")
def three_lines():
    """From top to bottom 60, 150 and 90 grey levels high."""
    light = drawn(SHAPE, row(40.0, 60.0), row(80.0, 150.0), row(120.0, 90.0))
    return recorded(light, np.random.default_rng(60))


def heights_at(stripe, u):
    return sorted(stripe.uv[np.rint(stripe.uv[:, 0]) == u, 1].tolist())


@pytest.mark.parametrize(
    ("lines", "expected"),
    [("all", [43.3, 83.3, 123.3]), ("brightest", [83.3]), ("first", [43.3]), ("last", [123.3])],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_of_several_lines_those_are_kept_that_are_asked_for(three_lines, lines, expected):
    """In column 120 the lines are 140/260 of 6 px lower than where they begin."""
    stripe = extract_stripe(three_lines, options=StripeOptions(lines=lines))
    assert stripe.lines == len(expected)
    assert np.allclose(heights_at(stripe, 120), np.array(expected) - 3.3 + 6 * 140 / 260, atol=0.2)


def test_lines_are_told_apart(three_lines):
    stripe = extract_stripe(three_lines)
    for index in range(3):
        assert np.ptp(stripe.uv[stripe.line == index, 1]) < 8.0


def test_a_region_is_a_part_of_the_whole(three_lines):
    """Noise and thresholds are the region's own, so centres agree within a tenth of their std."""
    whole = extract_stripe(three_lines)
    part = extract_stripe(three_lines, options=StripeOptions(region=(50, 60, 120, 45)))
    assert part.lines == 1
    inner = part.taken(part.good & (np.abs(part.uv[:, 0] - 110) < 50))
    assert len(inner) > 90
    for uv, std in zip(inner.uv, inner.std, strict=True):
        nearest = np.argmin(np.linalg.norm(whole.uv - uv, axis=1))
        assert np.linalg.norm(whole.uv[nearest] - uv) < 0.5 * std


def test_nothing_is_found_outside_the_mask(three_lines):
    mask = np.zeros(SHAPE, dtype=bool)
    mask[100:, 30:200] = True
    stripe = extract_stripe(three_lines, options=StripeOptions(mask=mask))
    columns, rows = np.rint(stripe.uv).astype(int).T
    assert len(stripe) > 160
    assert mask[rows, columns].all()


@pytest.mark.parametrize("scan", [None, "columns"], ids=["everywhere", "scan"])
@pytest.mark.parametrize(
    "region", [(-1, 0, 5, 5), (0, 0, 221, 5), (0, 0, 0, 5), (200, 150, 10, 11)], ids=str
)
def test_a_region_outside_the_picture_is_refused(three_lines, region, scan):
    with pytest.raises(InputError, match="does not lie in the picture of 220×160"):
        extract_stripe(three_lines, options=StripeOptions(region=region, scan=scan))


@pytest.mark.parametrize("scan", [None, "columns"], ids=["everywhere", "scan"])
def test_a_mask_of_another_size_is_refused(three_lines, scan):
    options = StripeOptions(mask=np.ones((3, 4), dtype=bool), scan=scan)
    with pytest.raises(InputError, match=r"mask has shape \(3, 4\)"):
        extract_stripe(three_lines, options=options)


@pytest.mark.parametrize(
    "wrong",
    [
        {"detector": "sobel"},
        {"lines": "best"},
        {"scan": "diagonals"},
        {"scan": "columns", "lines": "first"},
    ],
    ids=["detector", "lines", "scan", "scan-first"],
)
def test_unknown_words_are_refused_with_the_known_ones(wrong):
    with pytest.raises(InputError, match=r"choose|leave out"):
        StripeOptions(**wrong)


@pytest.mark.parametrize("channel", [0, 1, 2], ids=["first", "second", "third"])
def test_a_coloured_line_on_a_black_and_white_board_is_the_only_one(channel):
    """White, black and their edges have no colour, whatever they do to the line's height."""
    v, u = np.indices((240, 320))
    board = np.where((u // 32 + v // 32) % 2, 180.0, 25.0)
    light = drawn((240, 320), Strip((30.0, 130.0), (290.0, 150.0), amplitude=60.0))
    picture = np.repeat(board[..., None], 3, axis=2)
    picture[..., channel] += light * np.where(board > 100.0, 1.0, 0.5)
    stripe = extract_stripe(recorded(picture - 20.0, np.random.default_rng(61)))
    good = stripe.uv[stripe.good]
    assert len(good) > 220
    assert np.abs(good[:, 1] - 130.0 - (good[:, 0] - 30.0) / 13.0).max() < 1.0


def test_a_white_core_is_the_middle_not_a_hole():
    """Green is full over 10 px, red and blue over 4: the green excess has two ridges."""
    light = drawn((160, 220), Strip((-20.0, 70.3), (240.0, 80.3), amplitude=1.0, sheet=3.0))
    colours = 40.0 + light[..., None] * np.array([500.0, 1500.0, 500.0])
    noise = np.random.default_rng(62).normal(0.0, 2.0, colours.shape)
    picture = np.clip(np.rint(colours + noise), 0, 255).astype(np.uint8)
    stripe = extract_stripe(picture)
    assert stripe.lines == 1
    good = stripe.uv[stripe.good]
    assert np.abs(good[:, 1] - 70.3 - (good[:, 0] + 20.0) / 26.0).max() < 0.15


def test_a_bright_white_thread_beside_a_green_line_is_left_out():
    strips = {"thread": Strip((20.0, 30.0), (200.0, 40.0), amplitude=150.0), "laser": row(100.0)}
    light = {name: drawn(SHAPE, strip)[..., None] for name, strip in strips.items()}
    picture = light["thread"] * np.ones(3) + light["laser"] * np.array([0.2, 1.0, 0.2])
    stripe = extract_stripe(recorded(picture, np.random.default_rng(63)))
    assert stripe.lines == 1
    assert stripe.uv[:, 1].min() > 90.0


@pytest.mark.parametrize("contrast", [0.01, 1.0])
def test_no_centre_is_better_than_speckle_allows(three_lines, contrast):
    """The noise that the residuals show holds the speckle's already, where it is fine: the larger
    of the two counts, not their sum."""
    speckle = Speckle(contrast=contrast, wavelength_nm=660.0, aperture=8.0, pixel_um=3.45)
    without = extract_stripe(three_lines)
    with_it = extract_stripe(three_lines, options=StripeOptions(speckle=speckle))
    assert np.array_equal(with_it.uv, without.uv)
    assert np.allclose(with_it.std, np.maximum(without.std, speckle.std(without.width)))
    assert (with_it.std > without.std).any() == (contrast == 1.0)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")], ids=str)
def test_speckle_needs_positive_numbers(value):
    with pytest.raises(InputError, match="wavelength_nm"):
        Speckle(wavelength_nm=value)


@pytest.mark.parametrize(
    ("bits", "saturated"), [(10, False), (12, False), (16, False), (10, True), (12, True)]
)
def test_cameras_of_more_bits_give_the_same_centres(bits, saturated):
    """Ten and twelve bits fill a part of sixteen; the end of their scale is found."""
    gain = 2.0 ** (bits - 8)
    light = drawn(SHAPE, row(70.0, 500.0 if saturated else 150.0))
    grey = 20.0 + light + np.random.default_rng(64).normal(0.0, 2.0, SHAPE)
    picture = np.clip(np.rint(gain * grey), 0, 2**bits - 1).astype(np.uint16)
    stripe = extract_stripe(picture)
    good = stripe.taken(stripe.good)
    error = good.uv[:, 1] - 70.0 - 6.0 * (good.uv[:, 0] + 20.0) / 260.0
    assert len(good) > 200
    assert np.abs(error.mean()) < 0.01
    assert np.std(error / good.std) == pytest.approx(1.0, abs=0.2)
