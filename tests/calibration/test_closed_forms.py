"""The paper's closed forms: exact on exact data, and its misprints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.sheet_map_closed_form import sheet_map
from sheetoflight.calibration.starts import cameras, evidence, pivoting_state
from sheetoflight.calibration.target_triangulation import triangulated_targets
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import (
    in_plane_poses,
    pivot_poses,
    segments_in_sheet,
    target_points,
)
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from tests.calibration.examples import BROWN

targets = st.sampled_from([(0.0, 200.0, 400.0), (0.0, 120.0, 300.0), (0.0, 50.0, 170.0, 400.0)])


def starts(truth: SimulatedRig, uv: np.ndarray, skew: bool = False) -> list[RigState]:
    """What the pivoting views alone lead to."""
    names = tuple(str(i) for i in range(len(uv)))
    seen = Observations(camera=TargetViews(names, uv))
    rig = Rig(truth.target, truth.camera.image_size, skew=skew, observations=seen)
    found = evidence(rig)
    return [pivoting_state(rig, found, camera) for camera in cameras(rig, found)]


@given(targets, st.integers(0, 1000), st.booleans())
def test_the_pivoting_target_gives_the_camera_exactly(
    positions: tuple[float, ...], seed: int, skew: bool
) -> None:
    truth = paper_rig(target=CollinearTarget(positions))
    origins, directions = pivot_poses(truth, 12, np.random.default_rng(seed))
    points = target_points(origins, directions, truth.target.positions)
    start = starts(truth, truth.camera.project(points), skew)[0]
    assert np.allclose(start.camera.matrix, truth.camera.matrix, rtol=1e-6, atol=1e-4)
    assert np.allclose(start.anchor, truth.anchor_mm, atol=1e-3)
    assert np.allclose(start.poses["camera"], directions, atol=1e-6)


def test_a_missing_marker_does_not_bias_the_start() -> None:
    truth = paper_rig(target=CollinearTarget((0.0, 100.0, 250.0, 400.0)))
    points = target_points(
        *pivot_poses(truth, 12, np.random.default_rng(1)), truth.target.positions
    )
    uv = truth.camera.project(points)
    uv[::3, 2] = np.nan
    uv[1, 0] = np.nan
    start = starts(truth, uv)[0]
    assert np.allclose(start.camera.matrix, truth.camera.matrix, rtol=1e-6, atol=1e-4)


@given(targets, st.integers(0, 1000))
def test_targets_in_the_sheet_give_its_metric_homography(
    positions: tuple[float, ...], seed: int
) -> None:
    """Lengths on the sheet come from the pictures alone, no camera being known."""
    truth = paper_rig(target=CollinearTarget(positions))
    rng = np.random.default_rng(seed)
    points = target_points(*in_plane_poses(truth, 6, rng), truth.target.positions)
    uv = truth.camera.project(points)
    scale = np.array([[1e-3, 0, -0.7], [0, 1e-3, -0.5], [0, 0, 1.0]])
    found = sheet_map(uv * 1e-3 - [0.7, 0.5], truth.target.positions)
    assert found is not None
    ends = segments_in_sheet(truth, 300.0, 8, rng)
    image = truth.camera.project(ends)
    mapped = np.concatenate([image, np.ones_like(image[..., :1])], axis=-1) @ (found @ scale).T
    flat = mapped[..., :2] / mapped[..., 2:]
    assert np.allclose(np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1), 300.0, rtol=1e-6)


def planar_swings(truth: SimulatedRig, count: int) -> np.ndarray:
    """Image points of a target that swings in one plane."""
    angle = np.linspace(-0.6, 0.6, count)
    directions = np.stack([np.sin(angle), 0.3 * np.cos(angle), np.cos(angle)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    anchors = np.broadcast_to(truth.anchor_mm, directions.shape)
    return truth.camera.project(target_points(anchors, directions, truth.target.positions))


def test_swings_in_one_plane_give_no_camera_with_all_parameters() -> None:
    truth = paper_rig()
    found = starts(truth, planar_swings(truth, 15))
    assert all(np.isfinite(start.camera.matrix).all() for start in found)
    assert not any(np.allclose(s.camera.matrix, truth.camera.matrix, rtol=1e-3) for s in found)


def test_planar_swings_and_a_sheet_together_give_the_camera() -> None:
    """Each alone is degenerate; the equations of both determine K (zero skew)."""
    truth = paper_rig()
    lying = in_plane_poses(truth, 6, np.random.default_rng(2))
    uv = truth.camera.project(target_points(*lying, truth.target.positions))
    swings = planar_swings(truth, 15)
    seen = Observations(
        camera=TargetViews(tuple(str(i) for i in range(15)), swings),
        plane=TargetViews(tuple("abcdef"), uv),
    )
    rig = Rig(truth.target, truth.camera.image_size, observations=seen)
    first = next(cameras(rig, evidence(rig)))
    assert np.allclose(first.matrix, truth.camera.matrix, rtol=1e-4, atol=1e-2)


@given(st.sampled_from([(200.0, 200.0), (120.0, 180.0), (250.0, 60.0)]), st.integers(0, 1000))
def test_one_picture_of_three_points_gives_them_in_space(
    spacing: tuple[float, float], seed: int
) -> None:
    l1, l2 = spacing
    truth = paper_rig(BROWN, CollinearTarget((0.0, l1, l1 + l2)))
    rng = np.random.default_rng(seed)
    points = target_points(*in_plane_poses(truth, 8, rng), truth.target.positions)
    found = triangulated_targets(
        truth.camera.project(points), np.full(8, l1), np.full(8, l2), truth.camera
    )
    assert np.allclose(found, points, atol=1e-5)


def test_the_printed_weights_of_eq_7_are_wrong_by_60_mm() -> None:
    l1, l2 = 120.0, 180.0
    a, b = np.zeros(3), np.array([l1 + l2, 0.0, 0.0])
    printed = l1 / (l1 + l2) * a + l2 / (l1 + l2) * b
    right = l2 / (l1 + l2) * a + l1 / (l1 + l2) * b
    assert np.linalg.norm(right - a) == pytest.approx(l1)
    assert np.linalg.norm(printed - right) == pytest.approx(60.0)


def test_the_depth_error_of_a_tilted_target_is_common_to_its_markers() -> None:
    """Why the paper's pipeline loses: 0.1 px move a whole tilted target by a millimetre."""
    camera = Camera((1392, 1040), 2298.711, 2288.767, 689.341, 537.903)
    target = np.array([0.0, 200.0, 400.0])[:, None] * np.array([0.5, 0.0, np.sqrt(0.75)])
    points = np.broadcast_to(target + np.array([-100.0, 0.0, 900.0]), (400, 3, 3))
    uv = camera.project(points)
    noisy = uv + np.random.default_rng(2).normal(scale=0.1, size=uv.shape)
    found = triangulated_targets(noisy, np.array(200.0), np.array(200.0), camera)
    depth_error = found[..., 2] - points[..., 2]
    assert depth_error.std(axis=0).min() > 0.8
    correlation = np.atleast_2d(np.corrcoef(depth_error.T))
    assert correlation[np.triu_indices(3, 1)].min() > 0.95
