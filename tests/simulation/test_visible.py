"""Poses that are wholly in the picture, and how they are chosen."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.simulation.poses import pivot_poses
from sheetoflight.simulation.rig import paper_rig
from sheetoflight.simulation.visible import in_picture, target_points, visible_poses


def test_the_picture_ends_in_the_middle_of_its_outermost_pixels():
    camera = paper_rig().camera
    uv = np.array([[0.0, 0.0], [1391.0, 1039.0], [-0.01, 5.0], [5.0, 1039.01], [2.0, 2.0]])
    points = 800.0 * camera.unproject(uv + [1e-9, 1e-9] * np.sign(camera.matrix[:2, 2] - uv))
    assert in_picture(camera, points).tolist() == [True, True, False, False, True]
    assert in_picture(camera, points, 2.5).tolist() == [False] * 5
    assert not in_picture(camera, -points).any()


def test_a_longer_list_begins_with_the_shorter_one():
    few, many = (pivot_poses(paper_rig(), n, np.random.default_rng(0))[1] for n in (7, 3000))
    assert np.array_equal(few, many[:7])


def test_poses_are_those_drawn_in_their_order():
    rig = paper_rig()
    steps = iter(np.linspace(-400.0, 400.0, 81))

    def draw(n: int) -> tuple[np.ndarray, np.ndarray]:
        del n
        x = np.array([next(steps) for _ in range(27)])
        origins = np.stack([x, np.zeros(27), np.full(27, 1000.0)], axis=-1)
        return origins, np.tile([1.0, 0.0, 0.0], (27, 1))

    origins, directions = visible_poses(rig, 5, 0.0, draw, "poses", np.array([0.0, 100.0]))
    left = -rig.camera.u0 / rig.camera.alpha * 1000.0
    assert origins[:, 0] == pytest.approx(np.arange(-290.0, -240.0, 10.0))
    assert origins[0, 0] - 10.0 < left < origins[0, 0]
    assert in_picture(rig.camera, target_points(origins, directions, np.array([0.0, 100.0]))).all()


def test_nothing_is_drawn_for_no_pose():
    rng = np.random.default_rng(0)
    origins, _ = pivot_poses(paper_rig(), 0, rng)
    assert origins.shape == (0, 3)
    assert rng.random() == np.random.default_rng(0).random()


def test_too_few_poses_are_an_error():
    def draw(n: int) -> tuple[np.ndarray, np.ndarray]:
        return np.full((n, 3), -1000.0), np.tile([1.0, 0.0, 0.0], (n, 1))

    with pytest.raises(InputError, match=r"only 0 of 1 rods lie wholly in the picture.*wider lens"):
        visible_poses(paper_rig(), 1, 0.0, draw, "rods")
