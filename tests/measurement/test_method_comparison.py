"""Methods compared: the laws of the scores, from attempts whose errors are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.calibration.match_methods import MATCH_METHODS
from sheetoflight.calibration.methods import METHODS
from sheetoflight.cli.calibrate import calibrate
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import CONTESTANTS, PAPER_CASE, PRINTED_MM
from sheetoflight.measurement.method_comparison import MethodScore, compared
from sheetoflight.measurement.method_trial import (
    Attempt,
    LengthErrors,
    Yardstick,
    plane_errors,
)
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget

OPTIONS = ComparisonOptions(
    methods=("rod-joint",), lengths_mm=(20.0, 450.0), segments=6, trials=200
)
BOUND_MM = np.array([0.01, 0.1])[:, None] * np.linspace(0.5, 1.5, 6)


def attempts(scale: float = 1.0, trials: int = 200, seed: int = 1) -> list[tuple[Attempt]]:
    """Errors that are normal, with `scale` times the bound; stated as they are."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(trials):
        error = scale * BOUND_MM * rng.normal(size=BOUND_MM.shape)
        std = scale * BOUND_MM
        found = LengthErrors(error, std, np.abs(error) <= 1.959963984540054 * std)
        made.append((Attempt("rod-joint", "", 0.5, 0.1, 0.2, found, found, BOUND_MM),))
    return made


def score(trials: list[tuple[Attempt]]) -> MethodScore:
    return compared(replace(OPTIONS, trials=len(trials)), trials).scores[0]


def test_errors_at_the_bound_have_all_of_it_and_their_intervals_hold():
    """Odds of failing by chance: 6e-5 for each of three shares and two coverages."""
    found = score(attempts())
    assert found.bound_share_std == pytest.approx(1 / np.sqrt(2 * 12 * 200), rel=0.3)
    for one in (found, *found.lengths):
        assert abs(one.bound_share - 1.0) < 4 * one.bound_share_std
    assert abs(found.coverage - 0.95) < 4 * np.sqrt(0.95 * 0.05 / (12 * 200))
    assert found.measured_coverage == found.coverage
    assert [one.bound_mm for one in found.lengths] == pytest.approx(
        np.sqrt(np.mean(BOUND_MM**2, axis=1))
    )


def test_the_share_is_the_bound_over_the_error():
    plain, doubled = score(attempts()), score(attempts(2.0))
    assert doubled.bound_share == pytest.approx(plain.bound_share / 2)
    assert doubled.bound_share_std == pytest.approx(plain.bound_share_std / 2)
    for one, two in zip(plain.lengths, doubled.lengths, strict=True):
        assert two.rms_mm == pytest.approx(2 * one.rms_mm)
        assert two.predicted_mm == pytest.approx(2 * one.predicted_mm)
        assert two.bound_share == pytest.approx(two.bound_mm / two.rms_mm)
        assert two.bound_share == pytest.approx(one.bound_share / 2)
        assert two.bound_mm == one.bound_mm


def test_the_share_is_known_as_well_as_it_says():
    """Scatter of 60 shares against what each says of itself, which 1 in 10^4 times is 1.4 off."""
    many = [score(attempts(trials=30, seed=seed)) for seed in range(60)]
    scatter = np.std([one.bound_share for one in many], ddof=1)
    stated = np.sqrt(np.mean([one.bound_share_std**2 for one in many]))
    assert 1 / 1.4 < scatter / stated < 1.4


def test_refusals_are_counted_and_the_rest_is_judged_by_itself():
    good = attempts(trials=5)
    mixed = [*good[:2], (Attempt("rod-joint", refused="too few views"),), *good[2:]]
    with_refusal, without = score(mixed), score(good)
    assert (with_refusal.trials, with_refusal.refused) == (6, 1)
    assert with_refusal.first_refusal == "too few views"
    assert with_refusal.lengths == without.lengths


def test_where_every_method_refuses_nothing_is_compared():
    with pytest.raises(UntrustworthyError, match=r"refused every trial, .*: no light"):
        score([(Attempt("rod-joint", refused="no light"),)] * 2)


@pytest.mark.parametrize("name", CONTESTANTS)
@given(pictures=st.integers(0, 200), share=st.floats(0.01, 0.99))
def test_all_pictures_are_given_out(name: str, pictures: int, share: float):
    views = CONTESTANTS[name].views(pictures, share)
    assert tuple(views) == CONTESTANTS[name].stages
    assert sum(views.values()) == pictures
    assert min(views.values()) >= 0


def test_every_method_that_finds_a_sheet_is_compared():
    """All that the command line offers, but for those that find the camera alone."""
    offered = set(get_args(get_type_hints(calibrate)["method"]))
    assert set(METHODS) < offered
    assert {one.method for one in CONTESTANTS.values()} == offered - set(MATCH_METHODS)


def test_the_default_gives_a_rod_the_papers_pictures():
    options = ComparisonOptions()
    assert options.views(CONTESTANTS["rod-paper"]) == {"camera": 30, "plane": 10}
    assert options.views(CONTESTANTS["self-generated"]) == {"board": 30, "plate": 10}
    assert options.views(CONTESTANTS["rod-and-board"]) == {"camera": 15, "plane": 5, "board": 20}
    assert [one.name for one in options.contestants] == list(CONTESTANTS)


def test_the_papers_case_has_its_lengths_and_its_two_methods():
    """Average absolute errors 0.23 and 0.03 mm, as printed below Tables 3 and 4."""
    options = ComparisonOptions(case="paper")
    assert options.lengths == (20.0, 40.0, 60.0)
    assert set(PRINTED_MM) <= set(PAPER_CASE)
    means = {
        name: (3 * own[20.0] + 2 * own[40.0] + own[60.0]) / 6 for name, own in PRINTED_MM.items()
    }
    assert round(means["crossing-two-step"], 2) == 0.23
    assert round(means["rod-paper"], 2) == 0.03


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"methods": ("rod-joint", "guess")}, "method 'guess' cannot be compared – choose of rod"),
        ({"methods": ("rod-joint", "rod-joint")}, "named twice"),
        ({"case": "table"}, "choose sheet | paper"),
        ({"trials": 1}, "trials is 1 – give 2 or more"),
        ({"pictures": 0}, "pictures is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"camera_share": 1.0}, "share between 0 and 1"),
        ({"pixel_std": 0.0}, "above zero"),
        ({"end_std": float("nan")}, "above zero"),
        ({"lengths_mm": (20.0, -1.0)}, "above zero"),
        ({"distortion": (float("inf"), 0.0, 0.0, 0.0, 0.0)}, "finite"),
    ],
)
def test_what_cannot_be_compared_is_refused(wrong: dict[str, Any], said: str):
    with pytest.raises(InputError) as refusal:
        ComparisonOptions(**wrong)
    assert said in str(refusal.value)


def test_a_turned_and_a_shifted_sheet_are_as_far_off_as_they_were_moved():
    true = LightPlane(np.array([0.6, 0.0, 0.8]), 500.0)
    points = np.array([[0.0, y, 625.0] for y in (-100.0, 100.0)])  # on it, along y
    yardstick = Yardstick(true, points, np.zeros(0), np.zeros((0, 0, 2, 2)))
    angle = np.radians(0.5)
    turned = np.cos(angle) * true.normal + np.sin(angle) * np.array([0.0, 1.0, 0.0])
    distance = np.cos(angle) * 500.0  # about the line y = 0
    found = plane_errors(calibration(LightPlane(turned, distance)), yardstick)
    assert found == pytest.approx((0.5, 100.0 * np.sin(angle)))
    shifted = LightPlane(true.normal, 502.0)
    assert plane_errors(calibration(shifted), yardstick) == pytest.approx((0.0, 2.0))


def calibration(plane: LightPlane) -> Calibration:
    camera = Camera((1392, 1040), 2300.0, 2300.0, 690.0, 520.0)
    nothing = Covariance((), np.zeros((0, 0)))
    return Calibration(
        method="joint",
        camera=camera,
        light_planes=(plane,),
        covariance=nothing,
        residuals=Residuals(0.1, 1.0),
        target=CollinearTarget(),
        pixel_std=0.1,
    )
