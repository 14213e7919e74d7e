"""Derivatives and manifold of the adjustment."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.rig_state import (
    ANCHOR,
    LOCAL_SIZE,
    RigState,
    intrinsic_names,
    sheet_names,
)
from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.simulation.poses import (
    crossing_poses,
    crossing_spots,
    in_plane_poses,
    pivot_poses,
    target_points,
)
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.examples import simulated, two_lasers

TURNS = {("camera", 0), ("camera", 1), ("plane", 2), ("crossing", 3), ("crossing", 4)}
"""Parameters of views that are angles."""


def true_state(truth: SimulatedRig, views: tuple[int, int], seed: int = 0) -> RigState:
    """The state behind `simulated` observations of the same seed."""
    rng = np.random.default_rng(seed)
    directions = pivot_poses(truth, views[0], rng)[1]
    origins, along = in_plane_poses(truth, views[1], rng)
    frame = np.stack([*tangent_basis(truth.light_plane.normal), truth.light_plane.normal], axis=1)
    flat, turned = origins @ frame, along @ frame
    lying = np.stack([flat[:, 0], flat[:, 1], np.arctan2(turned[:, 1], turned[:, 0])], axis=1)
    return RigState(
        truth.camera,
        truth.anchor_mm,
        frame[None],
        np.array([truth.light_plane.distance_mm]),
        {"camera": directions, "plane": lying},
    )


def crossing_problem() -> tuple[Adjustment, RigState]:
    """Two sheets of light, targets lying in each and crossing each."""
    truth = two_lasers()
    rng = np.random.default_rng(5)
    middle = truth.target.positions.mean()
    lying, crossing = [], []
    uv, across = [], []
    frames = np.array(
        [np.stack([*tangent_basis(p.normal), p.normal], axis=1) for p in truth.light_planes]
    )
    for laser in range(2):
        origins, along = in_plane_poses(truth, 3, rng, laser=laser)
        flat, turned = origins @ frames[laser], along @ frames[laser]
        lying.append(np.stack([*flat[:, :2].T, np.arctan2(turned[:, 1], turned[:, 0])], axis=1))
        uv.append(truth.camera.project(target_points(origins, along, truth.target.positions)))
        origins, along = crossing_poses(truth, 3, rng, laser=laser)
        crossing.append(np.concatenate([origins + middle * along, along], axis=1))
        points = target_points(origins, along, truth.target.positions)
        spots = np.full((3, 2, 3), np.nan)
        spots[:, laser] = crossing_spots(truth.light_planes[laser], origins, along)
        across.append(truth.camera.project(np.concatenate([points, spots], axis=1)))
    stages = {
        "plane": TargetViews(tuple("abcdef"), np.concatenate(uv), laser=np.repeat([0, 1], 3)),
        "crossing": TargetViews(tuple("abcdef"), np.concatenate(across)),
    }
    std = {stage: np.full(views.uv.shape[:2], 0.5) for stage, views in stages.items()}
    free = (*intrinsic_names(Camera.PARAMETERS), *sheet_names(2))
    state = RigState(
        truth.camera,
        np.zeros(3),
        frames,
        np.array([p.distance_mm for p in truth.light_planes]),
        {"plane": np.concatenate(lying), "crossing": np.concatenate(crossing)},
    )
    return Adjustment(truth.target.positions, stages, std, free), state


def pivoting_problem() -> tuple[Adjustment, RigState]:
    truth, rig = simulated(0.0, (4, 3), distortion="brown")
    stages = rig.observations.stages()
    std = {stage: np.full(views.uv.shape[:2], 0.5) for stage, views in stages.items()}
    free = (*intrinsic_names(Camera.PARAMETERS), *ANCHOR, *sheet_names(1))
    return Adjustment(rig.target.positions, stages, std, free), true_state(truth, (4, 3))


@pytest.fixture(params=[pivoting_problem, crossing_problem], ids=["pivoting", "crossing"])
def problem(request: pytest.FixtureRequest) -> tuple[Adjustment, RigState]:
    return request.param()


def test_the_truth_has_no_residuals(problem: tuple[Adjustment, RigState]) -> None:
    adjustment, state = problem
    for block in adjustment.blocks(state):
        assert np.abs(block.residuals).max() < 1e-8
    for residuals in adjustment.residuals_px(state).values():
        assert np.nanmax(np.abs(residuals)) < 1e-8


def test_derivatives_by_shared_parameters_agree_with_differences(
    problem: tuple[Adjustment, RigState],
) -> None:
    adjustment, state = problem
    still = [np.zeros((len(v), LOCAL_SIZE[s])) for s, v in adjustment.stages.items()]
    blocks = adjustment.blocks(state)
    for index, name in enumerate(adjustment.parameters):
        h = 1e-6 if name.split(".")[1] in (*Camera.PARAMETERS[5:], "tilt1", "tilt2") else 1e-4
        step = h * np.eye(adjustment.shared_size)[index]
        above = adjustment.blocks(adjustment.moved(state, step, still))
        below = adjustment.blocks(adjustment.moved(state, -step, still))
        for block, up, down in zip(blocks, above, below, strict=True):
            slope = (up.residuals - down.residuals) / (2 * h)
            where = np.flatnonzero(block.columns == index)
            analytic = block.by_shared[..., where[0]] if len(where) else np.zeros_like(slope)
            assert np.allclose(analytic, slope, rtol=1e-5, atol=1e-4), name


def test_derivatives_by_poses_agree_with_differences(
    problem: tuple[Adjustment, RigState],
) -> None:
    adjustment, state = problem
    nothing = np.zeros(adjustment.shared_size)
    for which, stage in enumerate(adjustment.stages):
        for axis in range(LOCAL_SIZE[stage]):
            h = 1e-6 if (stage, axis) in TURNS else 1e-4
            local = [np.zeros((len(v), LOCAL_SIZE[s])) for s, v in adjustment.stages.items()]
            local[which][:, axis] = h
            above = adjustment.blocks(adjustment.moved(state, nothing, local))[which]
            below = adjustment.blocks(adjustment.moved(state, nothing, [-x for x in local]))[which]
            slope = (above.residuals - below.residuals) / (2 * h)
            analytic = adjustment.blocks(state)[which].by_local[..., axis]
            assert np.allclose(analytic, slope, rtol=1e-5, atol=1e-4)


def test_unseen_markers_count_for_nothing() -> None:
    truth, rig = simulated(0.1, (6, 4))
    stages = rig.observations.stages()
    uv = stages["camera"].uv.copy()
    uv[2, 1] = np.nan
    hidden = {**stages, "camera": type(stages["camera"])(stages["camera"].names, uv)}
    std = {stage: np.ones(views.uv.shape[:2]) for stage, views in stages.items()}
    free = (*intrinsic_names(rig.free_intrinsics), *ANCHOR, *sheet_names(1))
    full = Adjustment(rig.target.positions, stages, std, free)
    less = Adjustment(rig.target.positions, hidden, std, free)
    state = true_state(truth, (6, 4))
    seen, unseen = full.blocks(state)[0], less.blocks(state)[0]
    assert (unseen.residuals[2, 2:4] == 0).all()
    assert (unseen.by_shared[2, 2:4] == 0).all()
    assert (unseen.by_local[2, 2:4] == 0).all()
    rows = np.delete(np.arange(6), [2, 3])
    assert np.array_equal(seen.residuals[2, rows], unseen.residuals[2, rows])
    assert full.degrees_of_freedom - less.degrees_of_freedom == 2


def test_an_impossible_camera_is_not_stepped_into(
    problem: tuple[Adjustment, RigState],
) -> None:
    adjustment, state = problem
    step = np.zeros(adjustment.shared_size)
    step[0] = -1e9
    still = [np.zeros((len(v), LOCAL_SIZE[s])) for s, v in adjustment.stages.items()]
    assert adjustment.moved(state, step, still) is state
