"""A pivoting target's two stable poses."""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.pose_reselection import reselected_directions
from sheetoflight.model.observations import TargetViews
from sheetoflight.simulation.poses import pivot_poses, target_points
from sheetoflight.simulation.rig import paper_rig


def mirrored(directions: np.ndarray, anchor: np.ndarray, reach: float) -> np.ndarray:
    """The other direction in which the far marker appears at the same image point."""
    far = anchor + reach * directions
    rays = far / np.linalg.norm(far, axis=1, keepdims=True)
    other = (2 * rays @ anchor - np.linalg.norm(far, axis=1))[:, None] * rays
    return (other - anchor) / reach


def test_the_wrong_pose_is_recognised_and_replaced() -> None:
    truth = paper_rig()
    origins, directions = pivot_poses(truth, 20, np.random.default_rng(0))
    points = target_points(origins, directions, truth.target.positions)
    views = TargetViews(tuple(map(str, range(20))), truth.camera.project(points))
    wrong = mirrored(directions, truth.anchor_mm, truth.target.length_mm)
    assert np.allclose(np.linalg.norm(wrong, axis=1), 1.0)
    found, changed = reselected_directions(
        truth.camera, truth.anchor_mm, wrong, views, truth.target.positions
    )
    assert changed.all()
    assert np.allclose(found, directions, atol=1e-6)


def test_the_right_pose_stays_within_rounding() -> None:
    truth = paper_rig()
    origins, directions = pivot_poses(truth, 20, np.random.default_rng(0))
    points = target_points(origins, directions, truth.target.positions)
    views = TargetViews(tuple(map(str, range(20))), truth.camera.project(points))
    found, _ = reselected_directions(
        truth.camera, truth.anchor_mm, directions, views, truth.target.positions
    )
    assert np.allclose(found, directions, atol=1e-6)
