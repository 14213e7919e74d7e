"""Methods on one simulated rig: fair shares, and no error below what the pictures allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import CONTESTANTS
from sheetoflight.measurement.cramer_rao import bounding_calibration
from sheetoflight.measurement.method_comparison import MethodComparison, compared
from sheetoflight.measurement.method_trial import bound_mm
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.compared import compare, trial
from sheetoflight.workflow.contest import contest, simulated_evidence
from sheetoflight.workflow.spread import Execution

QUICK = ComparisonOptions(methods=("rod-two-step", "camera-free"), trials=4, segments=3)
EFFICIENT = ("rod-joint", "camera-free", "board-joint")


def without_times(found: MethodComparison) -> str:
    return repr([replace(score, seconds=0.0) for score in found.scores])


def test_two_processes_find_the_same_numbers_as_one():
    alone, together = compare(QUICK), compare(QUICK, Execution(processes=2))
    assert without_times(together) == without_times(alone)


def test_more_trials_begin_with_the_same_ones():
    plan = contest(QUICK)
    for name in QUICK.methods or ():
        few, _ = simulated_evidence(plan, CONTESTANTS[name], 1)
        more, _ = simulated_evidence(contest(replace(QUICK, trials=9)), CONTESTANTS[name], 1)
        assert np.array_equal(few.rig.observations.plane.uv, more.rig.observations.plane.uv)


def test_methods_are_given_the_same_pictures():
    plan = contest(ComparisonOptions())
    joint, paper, crossing = (
        simulated_evidence(plan, CONTESTANTS[name], 0)[0].rig.observations
        for name in ("rod-joint", "rod-paper", "crossing-joint")
    )
    assert np.array_equal(joint.plane.uv, paper.plane.uv)
    assert np.array_equal(joint.camera.uv, paper.camera.uv)
    assert np.array_equal(joint.camera.uv, crossing.camera.uv)


def test_the_views_differ_from_the_exact_ones_by_the_noise():
    """Standard deviations of some 200 and 7000 coordinates, to 5 of their standard errors."""
    plan = contest(ComparisonOptions(pixel_std=0.2))
    seen, exact = simulated_evidence(plan, CONTESTANTS["rod-and-board"], 0)
    for stage in ("camera", "plane", "board"):
        noise = getattr(seen.rig.observations, stage).uv
        noise = noise - getattr(exact.rig.observations, stage).uv
        assert abs(noise.std() / 0.2 - 1) < 5 / np.sqrt(2 * noise.size)
    assert len(seen.rig.observations.board.line) == 20 * 200


@pytest.mark.parametrize(
    "name", ["rod-joint", "crossing-joint", "camera-free", "board-joint", "self-generated"]
)
def test_the_bound_grows_with_the_noise_and_shrinks_with_the_views(name: str):
    """Information adds up: twice the noise is twice the bound, and a view more cannot harm."""
    options = ComparisonOptions(pictures=24, line_points=20, segments=3)
    plan, contestant = contest(options), CONTESTANTS[name]
    _, exact = simulated_evidence(plan, contestant, 0)
    method = "camera-free" if name == "camera-free" else "joint"

    def bound(rig: Rig, std: float) -> np.ndarray:
        bounding = bounding_calibration(rig, std, std, method, exact.camera)
        return bound_mm(bounding, plan.yardstick)

    once = bound(exact.rig, 0.1)
    assert bound(exact.rig, 0.2) == pytest.approx(2 * once, rel=1e-4)
    stage = contestant.stages[-1].replace("plate", "board")
    views = getattr(exact.rig.observations, stage)
    few = views.take(np.arange(len(views)) < len(views) - 1)
    seen = replace(exact.rig.observations, **{stage: few})
    assert (bound(replace(exact.rig, observations=seen), 0.1) > once).all()


def test_maximum_likelihood_reaches_the_bound_and_its_intervals_hold():
    """In the linear regime; 4 standard errors of the share, once in 4000 by chance a method."""
    options = ComparisonOptions(
        methods=EFFICIENT, pixel_std=0.02, trials=20, segments=4, line_points=20, seed=5
    )
    for score in compare(options, Execution(processes=2)).scores:
        assert not score.refused, score.first_refusal
        assert abs(score.bound_share - 1.0) < 4 * score.bound_share_std, score
        for length in score.lengths:
            assert length.predicted_mm == pytest.approx(length.bound_mm, rel=0.1)


def test_the_older_methods_are_given_the_same_boards_and_stay_far_from_the_bound():
    options = ComparisonOptions(
        methods=(
            "board-planar-lines",
            "board-cross-ratio",
            "solid-joint",
            "solid-cross-ratio",
            "solid-zigzag",
        ),
        pictures=8,
        trials=2,
        segments=3,
        line_points=60,
    )
    plan = contest(options)
    seen = {
        name: simulated_evidence(plan, CONTESTANTS[name], 0)[0].rig.observations.board
        for name in options.methods or ()
    }
    for one, other in (
        ("board-planar-lines", "board-cross-ratio"),
        ("solid-joint", "solid-zigzag"),
        ("solid-joint", "solid-cross-ratio"),
    ):
        assert np.array_equal(seen[one].uv, seen[other].uv)
        assert np.array_equal(seen[one].line.uv, seen[other].line.uv)
    for score in compare(options, Execution(processes=2)).scores:
        assert not score.refused, score.first_refusal
        assert score.plane_mm < 3.0
        if score.name != "solid-joint":
            assert score.bound_share < 1.0


def test_a_plate_has_its_camera_from_boards_that_the_laser_does_not_touch():
    plan = contest(ComparisonOptions())
    seen, exact = simulated_evidence(plan, CONTESTANTS["self-generated"], 0)
    assert seen.camera is not None
    assert exact.camera is not None
    boards, steps = seen.camera.observations.board, seen.rig.observations.board
    assert (len(boards), len(boards.line)) == (30, 0)
    assert (len(steps), len(steps.line), seen.rig.board) == (10, 20, None)
    for noise in (
        boards.uv - exact.camera.observations.board.uv,
        steps.line.uv - exact.rig.observations.board.line.uv,
    ):
        assert abs(noise.std() / 0.1 - 1) < 5 / np.sqrt(2 * noise.size)


def test_a_plates_intervals_hold_and_no_error_is_below_the_bound():
    """Eight boards and 32 steps, so that the camera's uncertainty is most of the lengths'. One
    length of each size a trial: squares over their variance are chi-squared with 30 degrees of
    freedom, the noise being estimated well. Two sizes and the share fail once in 2000 by chance."""
    options = ComparisonOptions(
        methods=("self-generated",),
        camera_share=0.2,
        lengths_mm=(20.0, 150.0),
        trials=30,
        segments=4,
    )
    plan = contest(options)
    attempts = [trial((plan, number)) for number in range(options.trials)]
    found = compared(options, attempts).scores[0]
    assert found.refused == 0
    assert found.bound_share < 1.0 + 4 * found.bound_share_std
    exact = [one.calibration for (one,) in attempts if one.calibration is not None]
    squares = np.sum([(one.error_mm[:, 0] / one.std_mm[:, 0]) ** 2 for one in exact], axis=0)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], len(exact))
    assert ((low < squares) & (squares < high)).all()
    for length in found.lengths:
        assert length.predicted_mm > length.bound_mm


def test_errors_grow_with_the_noise():
    """The same draws at twice the noise: errors double but for what is not linear."""
    options = ComparisonOptions(
        methods=("rod-joint", "rod-two-step", "camera-free", "board-joint", "self-generated"),
        trials=3,
        segments=3,
        line_points=20,
        pixel_std=0.005,
    )
    small, large = (compare(replace(options, pixel_std=std)).scores for std in (0.005, 0.01))
    for one, two in zip(small, large, strict=True):
        for own, other in zip(one.lengths, two.lengths, strict=True):
            assert other.rms_mm == pytest.approx(2 * own.rms_mm, rel=0.03)
            assert other.measured_rms_mm == pytest.approx(2 * own.measured_rms_mm, rel=0.03)
            assert other.bound_share == pytest.approx(own.bound_share, rel=0.03)


def test_a_refusal_is_counted_and_takes_nothing_from_the_others():
    """Three pictures of stage camera are too few for it; four of the sheet are enough."""
    rod, free = compare(replace(QUICK, pictures=4, trials=2)).scores
    assert (rod.refused, rod.trials, rod.lengths) == (2, 2, ())
    assert "3 views of the pivoting target, at least 5" in rod.first_refusal
    assert free.refused == 0
    assert len(free.lengths) == 6


def test_a_lens_is_estimated_where_there_is_one():
    options = replace(QUICK, distortion=(-0.1, 0.05, 0.0, 0.0, 0.0), trials=2)
    plan = contest(options)
    assert simulated_evidence(plan, CONTESTANTS["rod-two-step"], 0)[0].rig.distortion == "radial2"
    rod, free = compare(options).scores
    assert rod.refused == 0
    assert rod.lengths[-1].rms_mm < 1.0
    assert free.refused == free.trials
    assert "knows no camera and no lens" in free.first_refusal
