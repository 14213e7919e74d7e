"""The camera-rate scan, given as a stripe like any other."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from tests.imaging.stripe.drawn_lines import Strip, drawn, recorded

SHAPE = (160, 220)
SLOPE = 0.5
STRIP = Strip((-20.0, 30.0), (240.0, 30.0 + 260.0 * SLOPE), sheet=1.5)


@pytest.fixture(scope="module")
def picture():
    return recorded(drawn(SHAPE, STRIP), np.random.default_rng(70))


def normalised(stripe):
    distance = stripe.uv[:, 1] - 30.0 - SLOPE * (stripe.uv[:, 0] + 20.0)
    return distance / np.sqrt(1.0 + SLOPE**2) / stripe.std


def test_the_scan_has_true_uncertainties_across_the_line(picture):
    """220 normalised errors: a standard deviation between 0.83 and 1.19 in 999 of 1000 cases; the
    mean between ± 0.23."""
    stripe = extract_stripe(picture, options=StripeOptions(scan="columns"))
    assert len(stripe) > 210
    assert stripe.lines == 1
    assert 0.8 < np.std(normalised(stripe)) < 1.2
    assert abs(np.mean(normalised(stripe))) < 0.25
    direction = np.array([-SLOPE, 1.0]) / np.sqrt(1.0 + SLOPE**2)
    assert (np.abs(stripe.across @ direction) > 0.995).all()


def test_scan_and_search_agree(picture):
    """Different code, the same samples: most of the noise is common."""
    scanned = extract_stripe(picture, options=StripeOptions(scan="columns"))
    searched = extract_stripe(picture)
    shared = np.intersect1d(scanned.uv[:, 0], searched.uv[searched.good, 0])
    one = scanned.uv[np.isin(scanned.uv[:, 0], shared), 1]
    other = searched.uv[searched.good][np.isin(searched.uv[searched.good, 0], shared), 1]
    assert np.std(one - other) < 0.3 * np.median(scanned.std)


def test_rows_of_a_picture_are_columns_of_the_turned_one(picture):
    columns = extract_stripe(picture, options=StripeOptions(scan="columns"))
    rows = extract_stripe(picture.T.copy(), options=StripeOptions(scan="rows"))
    assert np.allclose(columns.uv, rows.uv[:, ::-1], atol=0.01)
    assert np.allclose(np.abs(columns.across), np.abs(rows.across[:, ::-1]), atol=0.01)


def test_an_off_picture_takes_away_a_brighter_line():
    lamp = drawn(SHAPE, Strip((-20.0, 20.0), (240.0, 20.0), amplitude=180.0))
    laser = drawn(SHAPE, Strip((-20.0, 90.0), (240.0, 95.0), amplitude=50.0))
    rng = np.random.default_rng(71)
    on, off = recorded(lamp + laser, rng), recorded(lamp, rng)
    stripe = extract_stripe(on, off, StripeOptions(scan="columns"))
    assert len(stripe) > 210
    assert stripe.uv[:, 1].min() > 85.0


def test_region_and_mask_keep_the_whole_picture_s_coordinates(picture):
    mask = np.zeros(SHAPE, dtype=bool)
    mask[:, 100:] = True
    whole = extract_stripe(picture, options=StripeOptions(scan="columns"))
    part = extract_stripe(
        picture, options=StripeOptions(scan="columns", region=(60, 20, 120, 130), mask=mask)
    )
    assert part.uv[:, 0].min() == 100.0
    assert part.uv[:, 0].max() == 179.0
    same = np.isin(whole.uv[:, 0], part.uv[:, 0])
    assert np.allclose(whole.uv[same], part.uv, atol=0.02)


@pytest.mark.parametrize(
    ("image", "off", "says"),
    [
        (np.zeros((60, 60)), None, "float64"),
        (np.zeros((60, 60, 4), np.uint8), None, "shape"),
        (np.zeros(60, np.uint8), None, "shape"),
        (np.zeros((60, 60), np.uint8), np.zeros((60, 61), np.uint8), "(60, 61)"),
    ],
    ids=["float", "four-channels", "flat", "size"],
)
def test_what_cannot_be_scanned_is_refused(image, off, says):
    with pytest.raises(InputError) as error:
        extract_stripe(image, off, StripeOptions(scan="columns"))
    assert says in str(error.value)


@pytest.mark.parametrize("detector", ["thin", "blais-rioux"])
def test_detectors_that_do_not_scan_say_so(picture, detector):
    with pytest.raises(InputError, match="does not scan"):
        extract_stripe(picture, options=StripeOptions(scan="columns", detector=detector))
