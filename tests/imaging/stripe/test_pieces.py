"""Pieces, their ends and what is no piece, against drawings whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.lines import LineOptions
from sheetoflight.imaging.stripe.pieces import line_pieces
from tests.imaging.stripe.drawn_lines import Strip, drawn, random_strip, recorded

SHAPE = (220, 220)


def point(uv) -> tuple[float, float]:
    return float(uv[0]), float(uv[1])


def one_piece(on, off=None):
    pieces = line_pieces(on, off)
    assert len(pieces) == 1
    return pieces[0]


@pytest.fixture(scope="module", params=[0.8, 2.0, 3.5], ids=lambda w: f"sheet-{w}px")
def measured(request):
    """Errors of ends and centres over 40 strips: pairs with noise 2 in each picture."""
    rng = np.random.default_rng(20)
    along, across, stated, centres = [], [], [], []
    for _ in range(40):
        strip = random_strip(rng, sheet=request.param)
        light = drawn(SHAPE, strip)
        piece = one_piece(recorded(light, rng), recorded(0.0 * light, rng))
        assert piece.whole
        outwards, aside = strip.offsets(piece.ends)
        along.extend(outwards)
        across.extend(aside)
        stated.extend(piece.ends_std)
        normal = np.array([-strip.along[1], strip.along[0]])
        centres.extend((piece.uv - strip.first) @ normal / piece.std)
    return tuple(np.array(values) for values in (along, across, stated, centres))


def test_ends_have_the_stated_uncertainty(measured):
    """80 normalised errors: their standard deviation leaves 0.72 … 1.29 once in 3000 times
    (chi-squared); 0.1 more is granted to the noise law, estimated from each picture."""
    along, _, stated, _ = measured
    # Ends and their uncertainties keep the piece's order, errors the strip's: pool both.
    ratio = np.sqrt(np.mean(along**2) / np.mean(stated**2))
    assert 0.62 < ratio < 1.39


def test_ends_are_unbiased(measured):
    """Mean of 80 errors within 3.9 of its standard errors (1 in 10 000) and 0.02 px."""
    along, across, _, _ = measured
    for errors in (along, across):
        assert abs(errors.mean()) < min(0.02, 3.9 * errors.std() / np.sqrt(errors.size) + 1e-3)


def test_ends_lie_on_the_line(measured):
    """The centre line near the end rests on at least 40 centres of at most 0.06 px each."""
    _, across, _, _ = measured
    assert across.std() < 0.03


def test_centres_have_the_stated_uncertainty(measured):
    """Thousands of normalised errors, correlated in none but the shared noise law."""
    normalised = measured[3]
    assert 0.85 < normalised.std() < 1.1
    assert abs(normalised.mean()) < 5.0 / np.sqrt(normalised.size)


def test_a_single_picture_will_do_where_the_line_is_brighter_than_its_strip():
    rng = np.random.default_rng(21)
    errors = []
    for _ in range(30):
        strip = random_strip(rng, ambient=40.0)
        piece = one_piece(recorded(drawn(SHAPE, strip), rng))
        assert piece.whole
        errors.extend(strip.offsets(piece.ends)[0])
    assert abs(np.mean(errors)) < 0.01
    assert np.std(errors) < 0.04


@pytest.mark.parametrize("degrees", range(0, 180, 15))
def test_no_direction_biases_the_end(degrees):
    """Without noise, rounding to grey levels (0.29, amplitude 150) leaves 0.005 px of noise."""
    half = 50.0 * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    middle = np.array([110.3, 109.6])
    strip = Strip(
        point(middle - half), point(middle + half), amplitude=150.0, shear=(0.7, -0.4), slope=0.002
    )
    on = np.rint(drawn(SHAPE, strip)).astype(np.uint8)
    along, across = strip.offsets(one_piece(on, np.zeros_like(on)).ends)
    assert np.abs(along).max() < 0.02
    assert np.abs(across).max() < 0.015


def test_a_saturated_core_does_not_move_the_end():
    rng = np.random.default_rng(22)
    errors = []
    for _ in range(12):
        strip = random_strip(rng, sheet=2.0, amplitude=600.0)
        light = drawn(SHAPE, strip)
        piece = one_piece(recorded(light, rng), recorded(0.0 * light, rng))
        errors.extend(np.concatenate(strip.offsets(piece.ends)))
    assert np.abs(errors).max() < 0.1


def test_turning_the_picture_turns_the_pieces():
    rng = np.random.default_rng(23)
    on = recorded(drawn(SHAPE, random_strip(rng)), rng)
    off = recorded(np.zeros(SHAPE), rng)
    straight = one_piece(on, off)
    turned = one_piece(on.T.copy(), off.T.copy())
    ends = turned.ends[:, ::-1]
    same_order = np.linalg.norm(ends - straight.ends) < np.linalg.norm(ends[::-1] - straight.ends)
    assert np.allclose(ends if same_order else ends[::-1], straight.ends, atol=0.02)


@pytest.mark.parametrize("gap", [3.0, 6.0, 20.0])
def test_a_gap_parts_the_line(gap):
    left = Strip((30.0, 100.0), (100.0, 110.0))
    along = left.along
    start = left.ends[1] + gap * along
    right = Strip(point(start), point(start + 70.0 * along))
    light = drawn(SHAPE, left, right)
    rng = np.random.default_rng(24)
    pieces = line_pieces(recorded(light, rng), recorded(0.0 * light, rng))
    assert len(pieces) == 2
    # Where the gap is wide enough for its edges to be told apart, both are found in place.
    if gap >= 6.0:
        assert np.abs(left.offsets(pieces[0].ends)[0]).max() < 0.15
        assert np.abs(right.offsets(pieces[1].ends)[0]).max() < 0.15


def test_a_dark_spot_that_leaves_half_the_light_does_not_part_it():
    strip = Strip((30.0, 100.0), (180.0, 120.0))
    light = drawn(SHAPE, strip)
    light[:, 100:110] *= 0.5
    rng = np.random.default_rng(25)
    assert one_piece(recorded(light, rng), recorded(0.0 * light, rng)).whole


def test_parallel_lines_stay_apart():
    lines = [Strip((100.0 + x, 20.0), (110.0 + x, 200.0)) for x in (0.0, 14.0)]
    light = drawn(SHAPE, *lines)
    rng = np.random.default_rng(26)
    pieces = line_pieces(recorded(light, rng), recorded(0.0 * light, rng))
    assert len(pieces) == 2
    for line, piece in zip(lines, pieces, strict=True):
        assert np.abs(line.offsets(piece.ends)[0]).max() < 0.15


def test_a_piece_that_leaves_the_picture_is_not_whole():
    rng = np.random.default_rng(27)
    light = drawn(SHAPE, Strip((60.0, -30.0), (90.0, 120.0)))
    piece = one_piece(recorded(light, rng), recorded(0.0 * light, rng))
    assert not piece.whole
    assert np.isnan(piece.ends_std[0])
    assert piece.ends[0, 1] < 3.0
    assert np.allclose(piece.ends[1], [90.0, 120.0], atol=0.15)


def test_pieces_come_from_top_to_bottom_then_left_to_right():
    strips = [
        Strip((150.0, 20.0), (200.0, 25.0)),
        Strip((40.0, 60.0), (30.0, 130.0)),
        Strip((120.0, 60.0), (130.0, 130.0)),
        Strip((20.0, 180.0), (100.0, 170.0)),
    ]
    light = drawn(SHAPE, *strips)
    rng = np.random.default_rng(28)
    pieces = line_pieces(recorded(light, rng, 0.5), recorded(0.0 * light, rng, 0.5))
    tops = [piece.ends[0] for piece in pieces]
    assert [round(float(v)) for _, v in tops] == [20, 60, 60, 180]
    assert np.allclose(tops[0], [150.0, 20.0], atol=0.2)
    assert np.allclose(tops[3], [20.0, 180.0], atol=0.2)


def test_a_faint_piece_is_found_beside_a_bright_one():
    """A wall in shadowless light gives some 15 grey levels where the bar gives 100."""
    bright = Strip((40.0, 60.0), (160.0, 90.0), amplitude=100.0)
    faint = Strip((40.0, 150.0), (160.0, 180.0), amplitude=15.0)
    light = drawn(SHAPE, bright, faint)
    rng = np.random.default_rng(29)
    off = recorded(0.0 * light, rng, 0.7)
    assert len(line_pieces(recorded(light, rng, 0.7), off)) == 2


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_every_sample_type_gives_the_same_ends(dtype):
    rng = np.random.default_rng(30)
    strip = random_strip(rng)
    on, off = recorded(drawn(SHAPE, strip), rng), recorded(np.zeros(SHAPE), rng)
    reference = one_piece(on, off)
    factor = 1 if dtype is np.uint8 else 200
    scaled = [(image.astype(float) * factor).astype(dtype) for image in (on, off)]
    assert np.allclose(one_piece(*scaled).ends, reference.ends, atol=0.01)


@pytest.mark.parametrize("channel", [0, 1, 2], ids=["first", "second", "third"])
def test_a_coloured_line_is_found_whatever_its_channel(channel):
    rng = np.random.default_rng(31)
    strip = random_strip(rng)
    share = np.full(3, 0.15)
    share[channel] = 1.0
    light = drawn(SHAPE, strip)[..., None] * share
    piece = one_piece(recorded(light, rng), recorded(0.0 * light, rng))
    assert np.abs(strip.offsets(piece.ends)[0]).max() < 0.2


def test_a_core_saturated_to_white_is_one_line():
    """In one channel alone, or in a difference of channels, it would be two."""
    rng = np.random.default_rng(32)
    strip = random_strip(rng, sheet=2.5, amplitude=900.0)
    light = drawn(SHAPE, strip)[..., None] * np.array([0.4, 1.0, 0.4])
    piece = one_piece(recorded(light, rng))
    assert np.abs(strip.offsets(piece.ends)[1]).max() < 0.1


def board(side: int) -> np.ndarray:
    v, u = np.indices((300, 400))
    return np.where((u // side + v // side) % 2, 190.0, 30.0)


EMPTY = {
    "noise": lambda rng: recorded(np.full((300, 400), 60.0), rng, 4.0),
    "dark": lambda rng: recorded(np.zeros((300, 400)), rng, 3.0, dark=0.0),
    "black": lambda _: np.zeros((300, 400), np.uint8),
    "white": lambda _: np.full((300, 400), 255, np.uint8),
    "ramp": lambda rng: recorded(np.indices((300, 400)).sum(axis=0) / 4.0, rng),
    "board-8": lambda rng: recorded(board(8), rng),
    "board-20": lambda rng: recorded(board(20), rng),
    "board-50": lambda rng: recorded(board(50), rng),
    "edge": lambda rng: recorded(np.where(np.indices((300, 400))[1] < 200, 20.0, 180.0), rng),
    "one-pixel": lambda _: np.full((1, 1), 7, np.uint8),
    "one-row": lambda rng: recorded(np.zeros((1, 400)), rng),
    "narrow": lambda rng: recorded(np.zeros((9, 9)), rng),
    "colour-noise": lambda rng: recorded(np.full((300, 400, 3), 60.0), rng, 4.0),
}


@pytest.mark.parametrize("name", EMPTY)
def test_nothing_is_found_where_there_is_no_line(name):
    rng = np.random.default_rng(33)
    assert line_pieces(EMPTY[name](rng)) == ()


@pytest.mark.parametrize("name", EMPTY)
def test_nothing_is_found_in_a_pair_without_laser(name):
    rng = np.random.default_rng(34)
    assert line_pieces(EMPTY[name](rng), EMPTY[name](rng)) == ()


def test_the_background_does_not_matter_in_a_pair():
    rng = np.random.default_rng(35)
    strip = random_strip(rng, amplitude=60.0)
    background = np.where(np.indices(SHAPE).sum(axis=0) // 20 % 2, 120.0, 20.0)
    light = drawn(SHAPE, strip)
    piece = one_piece(recorded(light + background, rng), recorded(background, rng))
    assert np.abs(strip.offsets(piece.ends)[0]).max() < 0.3


def test_the_same_pictures_give_the_same_pieces():
    rng = np.random.default_rng(36)
    on = recorded(drawn(SHAPE, random_strip(rng)), rng)
    first, second = one_piece(on), one_piece(on)
    assert np.array_equal(first.uv, second.uv)
    assert np.array_equal(first.ends, second.ends)


@pytest.mark.parametrize(
    ("on", "off", "says"),
    [
        (np.zeros((4, 5, 4), np.uint8), None, "shape"),
        (np.zeros(5, np.uint8), None, "shape"),
        (np.zeros((0, 5), np.uint8), None, "shape"),
        (np.zeros((9, 9), bool), None, "bool"),
        (np.full((9, 9), np.nan), None, "not finite"),
        (np.zeros((9, 9), np.uint8), np.zeros((9, 8), np.uint8), "(9, 8)"),
        (np.zeros((9, 9), np.uint8), np.zeros((9, 9), np.uint16), "uint16"),
        (np.zeros((9, 9), np.uint8), np.zeros((9, 9, 3), np.uint8), "(9, 9, 3)"),
    ],
    ids=["four-channels", "flat", "empty", "bool", "nan", "size", "depth", "colour"],
)
def test_what_is_no_picture_is_refused(on, off, says):
    with pytest.raises(InputError) as error:
        line_pieces(on, off)
    assert says in str(error.value)


@pytest.mark.parametrize("value", [-1.0, float("nan")], ids=["negative", "nan"])
def test_options_are_checked(value):
    with pytest.raises(InputError, match="seed_snr"):
        LineOptions(seed_snr=value)
