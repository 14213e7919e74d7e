"""A camera that was known before is believed only where the boards do not contradict it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

import sheetoflight as sol
from sheetoflight.calibration.known_camera import (
    CameraTest,
    doubts_of_known_camera,
    known_camera_test,
)
from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.rig import Rig
from tests.calibration.boards import rig_of, seen_boards, without_lines

RIGHT = 40


def seen_again(seed: int, views: int = 8, std: float = 0.2, model: str = "radial2") -> Rig:
    """Boards before one and the same camera."""
    truth, seen = seen_boards(np.random.default_rng(seed), views, std)
    return rig_of(truth, without_lines(seen), model)


def with_focus(rig: Rig, camera: Camera, factor: float) -> Rig:
    """The rig with a camera whose focal lengths are wrong by a factor."""
    wrong = replace(camera, alpha=factor * camera.alpha, beta=factor * camera.beta)
    return replace(rig, camera=wrong)


def compared(rig: Rig) -> CameraTest:
    found = known_camera_test(rig)
    assert found is not None
    return found


@pytest.mark.parametrize("exact", [True, False], ids=["true camera", "estimated camera"])
def test_odds_of_right_cameras_are_those_of_chance(exact: bool) -> None:
    """Uniform from 0 to 1: of 40, more than 12 lie below 0.1, or fewer than 11 above 0.5, once in
    2 000 times, and one lies below 1e-4 once in 250."""
    truth, _ = seen_boards(np.random.default_rng(0), 3)
    odds = []
    for seed in range(RIGHT):
        rig = seen_again(seed, 5 + seed % 6, model="brown" if seed % 4 == 0 else "radial2")
        if exact:
            known = replace(rig, camera=truth.camera)
        else:
            before = calibrate(seen_again(1000 + seed, 8, 0.4, rig.distortion))
            known = replace(rig, camera=before.camera, camera_covariance=before.covariance)
        odds.append(compared(known).odds)
    assert min(odds) > 1e-4
    assert sum(value < 0.1 for value in odds) <= 12
    assert sum(value > 0.5 for value in odds) >= 11


def test_a_camera_of_another_focus_is_refused_by_name() -> None:
    truth, views = seen_boards(np.random.default_rng(1), 8, 0.1, 0.1)
    rig = with_focus(rig_of(truth, views), truth.camera, 0.8)
    with pytest.raises(UntrustworthyError, match="not that of these pictures") as caught:
        sol.calibrate(rig)
    assert caught.value.exit_status == 3
    words = str(caught.value)
    name = "alpha" if "its alpha" in words else "beta"
    assert f"its {name} is {getattr(rig.camera, name):.6g}" in words
    assert "--camera" in caught.value.remedy


def test_a_slight_difference_is_told_with_opencv_s_own_estimate() -> None:
    truth, views = seen_boards(np.random.default_rng(2), 10, 0.3)
    rounded = views.uv.astype(np.float32)
    rig = rig_of(truth, without_lines(replace(views, uv=rounded, std=None)), "brown")
    rig = with_focus(rig, truth.camera, 1.02)
    found = compared(rig)
    assert found.odds < 1e-3
    assert found.growth < 2.0
    assert len(doubts_of_known_camera(rig)) == 1
    assert truth.board is not None
    points = [truth.board.points.astype(np.float32)] * len(views)
    pixels = [uv[:, None] for uv in rounded]
    _, matrix, _, _, _ = cv2.calibrateCamera(
        points, pixels, truth.camera.image_size, None, None, criteria=(3, 200, 1e-15)
    )
    focal = matrix[0, 0] if found.parameter == "alpha" else matrix[1, 1]
    assert found.found == pytest.approx(focal, rel=1e-6)


def test_growth_is_that_of_opencv_s_poses() -> None:
    truth, views = seen_boards(np.random.default_rng(3), 8, 0.3)
    rig = with_focus(rig_of(truth, without_lines(views)), truth.camera, 0.97)
    known = rig.camera
    assert known is not None
    assert truth.board is not None
    squares = []
    for uv in views.uv:
        shift = truth.board.points, uv, known.matrix, np.array(known.distortion)
        _, turn, move = cv2.solvePnP(*shift)
        turn, move = cv2.solvePnPRefineLM(*shift, turn, move)
        again = cv2.projectPoints(truth.board.points, turn, move, *shift[2:])[0][:, 0]
        squares.append((again - uv) ** 2)
    rms = float(np.sqrt(np.mean(squares)))
    assert compared(rig).residual_px == pytest.approx(rms, rel=1e-3)


def test_a_camera_that_is_said_to_be_vague_is_not_doubted() -> None:
    truth, views = seen_boards(np.random.default_rng(4), 8, 0.1)
    rig = with_focus(rig_of(truth, without_lines(views)), truth.camera, 0.98)
    names = ("camera.alpha", "camera.beta")
    vague = Covariance(names, np.full((2, 2), (0.02 * truth.camera.alpha) ** 2) + np.eye(2))
    assert compared(rig).odds < 1e-5
    assert doubts_of_known_camera(replace(rig, camera_covariance=vague)) == ()


def test_a_lens_that_only_the_known_camera_has_is_no_difference() -> None:
    """The rig's lens model says what to estimate, not what a known camera may have."""
    truth, views = seen_boards(np.random.default_rng(5), 8, 0.2)
    rig = replace(rig_of(truth, without_lines(views), "none"), camera=truth.camera)
    assert compared(rig).odds > 1e-3


def test_boards_that_cannot_tell_the_camera_say_nothing() -> None:
    truth, views = seen_boards(np.random.default_rng(6), 1, 0.2)
    rig = with_focus(rig_of(truth, without_lines(views), "brown"), truth.camera, 0.8)
    assert known_camera_test(rig) is None


def test_exact_pictures_and_the_exact_camera_agree() -> None:
    truth, views = seen_boards(np.random.default_rng(7), 8)
    rig = replace(rig_of(truth, views), camera=truth.camera)
    assert doubts_of_known_camera(rig) == ()
