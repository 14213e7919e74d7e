"""The spot where the sheet crosses the target, in pictures drawn without package code.

With the true spot known, an error over its stated standard deviation is a pull; of N pictures the
sum of squared pulls is χ² with N degrees of freedom if what is stated is true.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sheetoflight.imaging.crossing import SpotSearch, SpotSighting, find_spot
from sheetoflight.imaging.markers import TargetSighting, find_target
from sheetoflight.model.target import CollinearTarget
from tests.imaging.crossings import Crossing, view
from tests.imaging.drawing import draw, homography, mapped

TARGET = CollinearTarget()
PLAIN = Crossing(view())


def sighted(picture: np.ndarray, target: CollinearTarget = TARGET) -> TargetSighting:
    search = find_target(picture, target)
    assert search.sighting is not None, search.reason
    return search.sighting


def searched(crossing: Crossing, pair: bool = True, seed: int = 0) -> SpotSearch:
    target = replace(TARGET, marker=crossing.kind)
    off, on = crossing.pair(seed)
    if pair:
        return find_spot(on, target, sighted(off, target), off)
    return find_spot(on, target, sighted(on, target))


def seen(search: SpotSearch) -> SpotSighting:
    assert search.spot is not None, search.reason
    return search.spot


def error(spot: SpotSighting, crossing: Crossing) -> float:
    """Along the axis, px."""
    return float((spot.uv - crossing.spot) @ crossing.along)


CASES: dict[str, dict[str, Any]] = {
    "at right angles": {},
    "oblique": {"slant": np.radians(50.0)},
    "oblique the other way": {"slant": np.radians(-55.0), "spot_mm": 290.0},
    "no line behind the strip": {"behind": None},
    "a step a little behind": {"behind": 4.0, "wall": 80.0},
    "a wall as bright as paper": {"wall": 90.0, "behind": -8.0},
    "a strip little higher than its markers": {"half_height": 15.0},
    "beyond the last marker": {"spot_mm": 418.0},
    "saturated": {"peak": 500.0},
    "faint": {"peak": 12.0},
    "wide": {"sigma_mm": 4.0},
    "out of focus": {"blur": 2.0},
    "discs": {"kind": "disc"},
    "tilted": {"matrix": view(tilt=0.9, spin=-0.5)},
    "upside down": {"matrix": view(roll=0.3 + np.pi, centre=(350.0, 200.0))},
    "upright": {"matrix": view(radius=6.5, roll=np.pi / 2, centre=(200.0, 20.0))},
}


@pytest.mark.parametrize("pair", [True, False], ids=["pair", "single"])
@pytest.mark.parametrize("case", CASES.keys())
def test_the_spot_is_found_to_its_stated_uncertainty(case: str, pair: bool) -> None:
    """Each bound is missed by chance once in 16 000 cases; 0.02 px is allowed to the drawing,
    whose samples are a quarter of a pixel wide."""
    crossing = replace(PLAIN, **CASES[case])
    spot = seen(searched(crossing, pair))
    limit = 4 * spot.std + 0.02
    assert abs(error(spot, crossing)) < limit
    assert spot.std < (0.15 if case == "faint" else 0.05)
    across = (spot.uv - crossing.spot) @ [-crossing.along[1], crossing.along[0]]
    assert abs(across) < 4 * spot.across_std + 0.02


def small(seed: int) -> Crossing:
    """A random crossing in a small noisy picture; the strip is about 24 px high."""
    rng = np.random.default_rng([5, seed])
    matrix = homography(
        500.0, 1000.0, (25.0, 40.0), *rng.uniform([-0.4, -0.4, 0.1], [0.4, 0.4, 0.4])
    )
    return Crossing(
        matrix,
        spot_mm=float(rng.choice([rng.uniform(30.0, 170.0), rng.uniform(230.0, 370.0)])),
        slant=rng.uniform(-1.0, 1.0),
        sigma_mm=rng.uniform(2.0, 4.0),
        behind=rng.uniform(-30.0, 30.0),
        noise=4.0,
        shape=(180, 270),
    )  # fmt: skip


def pulls_and_errors(count: int, pair: bool) -> tuple[np.ndarray, np.ndarray]:
    crossings = [small(seed) for seed in range(count)]
    spots = [seen(searched(one, pair, seed)) for seed, one in enumerate(crossings)]
    errors = np.array([error(*both) for both in zip(spots, crossings, strict=True)])
    return errors / [spot.std for spot in spots], errors


def test_stated_uncertainties_are_true() -> None:
    """24 pairs: χ² with 24 degrees of freedom lies between 7.5 and 56 but for one seed in 2500."""
    pulls, _ = pulls_and_errors(24, pair=True)
    assert 7.5 < np.square(pulls).sum() < 56.0


@pytest.mark.accuracy
@pytest.mark.parametrize("pair", [True, False], ids=["pair", "single"])
def test_stated_uncertainties_are_true_over_many_pictures(pair: bool) -> None:
    """240 pictures: the root mean square pull has a standard deviation of 0.046, so 0.2 is missed
    by chance once in 70 000; the mean error's is a tenth of the bound."""
    pulls, errors = pulls_and_errors(240, pair)
    rms = np.sqrt(np.mean(pulls**2))
    assert 0.8 < rms < 1.2
    assert abs(errors.mean()) < 0.02


def test_a_bright_line_on_a_strip_of_24_px_gives_a_spot_to_hundredths() -> None:
    spot = seen(searched(replace(PLAIN, matrix=view(radius=6.0), sigma_mm=2.0)))
    assert 0.002 < spot.std < 0.03
    assert np.degrees(spot.angle) == pytest.approx(85.0, abs=8.0)


def test_a_line_through_a_marker_is_measured_on_paper_alone() -> None:
    for spot_mm, slant in ((204.0, 0.8), (4.0, 0.0)):
        crossing = replace(PLAIN, spot_mm=spot_mm, slant=slant)
        spot = seen(searched(crossing))
        assert abs(error(spot, crossing)) < 4 * spot.std + 0.02


def test_a_single_picture_tells_no_spot_on_a_marker() -> None:
    crossing = replace(PLAIN, spot_mm=204.0, slant=0.8)
    search = searched(crossing, pair=False)
    assert search.spot is None
    assert "runs through marker 1" in search.reason


def test_which_end_is_first_does_not_matter() -> None:
    off, on = PLAIN.pair()
    sighting = sighted(off)
    forward = seen(find_spot(on, TARGET, sighting, off))
    positions = tuple(400.0 - s for s in reversed(TARGET.markers_mm))
    backward = seen(find_spot(on, CollinearTarget(positions), sighting.reversed(), off))
    np.testing.assert_allclose(backward.uv, forward.uv, atol=1e-3)
    assert backward.std == pytest.approx(forward.std, rel=1e-2)


def test_samples_and_colour_make_no_difference() -> None:
    off, on = PLAIN.pair()
    sighting = sighted(off)
    expected = seen(find_spot(on, TARGET, sighting, off))
    deep = seen(find_spot(on.astype(np.uint16) * 16, TARGET, sighting, off.astype(np.uint16) * 16))
    np.testing.assert_allclose(deep.uv, expected.uv, atol=1e-4)
    assert deep.std == pytest.approx(expected.std, rel=1e-2)
    coloured = np.stack([off, off, on], axis=-1)
    red = seen(find_spot(coloured, TARGET, sighting))
    assert abs(error(red, PLAIN)) < 4 * red.std + 0.02


def test_a_bent_axis_is_followed() -> None:
    """A lens that distorts bends the axis; through three markers goes one parabola, which between
    two of them, a quarter of the way, has moved by three quarters of the middle marker's move."""
    crossing = replace(PLAIN, matrix=view(tilt=0.0, spin=0.0), spot_mm=100.0)
    off, on = crossing.pair()
    markers = mapped(crossing.matrix, np.column_stack([crossing.markers, np.zeros(3)]))
    normal = np.array([-crossing.along[1], crossing.along[0]])
    sighting = replace(sighted(off), uv=markers + [[0.0], [2.0], [0.0]] * normal)
    spot = seen(find_spot(on, TARGET, sighting, off))
    assert (spot.uv - crossing.spot) @ normal == pytest.approx(1.5, abs=0.02)
    # The line, not quite at right angles to the axis, is followed as well.
    across = mapped(crossing.matrix, np.array([[100.0, 5.0], [100.0, -5.0]]))
    along_line = (across[0] - across[1]) / np.linalg.norm(across[0] - across[1])
    off_line = spot.uv - crossing.spot - along_line * ((spot.uv - crossing.spot) @ along_line)
    assert np.linalg.norm(off_line) < 4 * spot.std + 0.02


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "laser off": ({"peak": 0.0}, "no laser line on the target's strip"),
    "beyond the end": ({"spot_mm": 480.0, "behind": 0.0}, "no laser line on the target's strip"),
    "nearly parallel": ({"slant": np.radians(84.0), "spot_mm": 200.0}, "stage plane"),
    "two lines": ({"others": ((290.0, 90.0),)}, "two lines cross the target's strip"),
    "far too wide": ({"sigma_mm": 25.0}, "too wide for a line|no laser line"),
}


@pytest.mark.parametrize("pair", [True, False], ids=["pair", "single"])
@pytest.mark.parametrize("case", REFUSED.keys())
def test_what_is_no_spot_is_refused_with_its_reason(case: str, pair: bool) -> None:
    changes, reason = REFUSED[case]
    crossing = replace(PLAIN, **changes)
    off, on = crossing.pair()
    search = find_spot(on, TARGET, sighted(off), off if pair else None)
    assert search.spot is None
    assert any(words in search.reason for words in reason.split("|")), search.reason


@pytest.mark.parametrize("pair", [True, False], ids=["pair", "single"])
def test_a_target_in_the_sheet_is_no_crossing(pair: bool) -> None:
    matrix = view()
    off = draw(PLAIN.shape, matrix, PLAIN.markers, paper=90.0, seed=1)
    on = draw(PLAIN.shape, matrix, PLAIN.markers, paper=90.0, seed=2, laser=(0.0, 1.2, 1.5))
    search = find_spot(on, TARGET, sighted(off), off if pair else None)
    assert search.spot is None
    assert "stage plane" in search.reason


def test_a_strip_that_is_saturated_throughout_is_refused() -> None:
    off, on = (
        np.minimum(picture.astype(int) * 3, 255).astype(np.uint8) for picture in PLAIN.pair()
    )
    search = find_spot(on, TARGET, sighted(PLAIN.drawn(False)), off)
    assert search.spot is None
    assert "saturated" in search.reason


@pytest.mark.parametrize(
    ("shift", "told"), [(0.5, "by about 0.5 px"), (2.0, "by about")], ids=["little", "much"]
)
def test_a_target_that_moved_within_a_pair_is_refused(shift: float, told: str) -> None:
    moved = np.array([[1.0, 0.0, shift], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ PLAIN.matrix
    off, on = PLAIN.drawn(False), replace(PLAIN, matrix=moved).drawn(True)
    search = find_spot(on, TARGET, sighted(off), off)
    assert search.spot is None
    assert f"the target moved {told}" in search.reason


def test_other_light_in_the_room_is_no_move() -> None:
    off, on = replace(PLAIN, paper=60.0, ink=5.0).drawn(False), PLAIN.drawn(True)
    spot = seen(find_spot(on, TARGET, sighted(off), off))
    assert abs(error(spot, PLAIN)) < 4 * spot.std + 0.02
