"""Where only boards were shown, what is said to be done can be done with boards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.identifiability import RECORDING
from sheetoflight.calibration.board_start import boards_alone
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.identifiability import determined
from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.remedies import remedy, stage_of
from sheetoflight.calibration.search import best_fit
from sheetoflight.calibration.starts import with_sheets
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from sheetoflight.simulation.poses import recorded
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from tests.calibration.boards import rig_of, seen_boards, without_lines

OF_RODS = ("target", "marker", "swing")
LENS = (-0.1, 0.05, 0.0, 0.0, 0.0)


def refusal(rig: Rig, method: str = "joint") -> UntrustworthyError:
    with pytest.raises(UntrustworthyError) as caught:
        calibrate(rig, method)
    assert caught.value.exit_status == 3
    return caught.value


def held(truth: SimulatedRig, parallel: bool = False, views: int = 8) -> Rig:
    """Boards held before a rig, each turned somehow, or all parallel to the picture."""
    rng = np.random.default_rng(1)
    board = truth.board
    assert board is not None
    turns, shifts = board_poses(truth, board, views, rng)
    if parallel:
        turns = rotation(np.outer(np.linspace(-0.5, 0.5, views), [0.0, 0.0, 1.0]))
    placed = placed_boards(truth, board, turns, shifts)
    seen = photographed_boards(truth.camera, placed, rng, 0.2, 0.2)
    return rig_of(truth, seen)


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_boards_without_tilt_are_to_be_tilted(method: str) -> None:
    """A plane parallel to the picture says nothing of the focal length (Zhang 2000, section 4)."""
    rig = held(board_rig(None, LENS), parallel=True)
    error = refusal(rig, method)
    assert error.stage == "board"
    assert "tilted by 20° to 50°" in error.remedy
    assert not any(word in str(error) for word in OF_RODS)


def test_a_sheet_through_the_camera_is_told_as_what_it_is() -> None:
    truth = board_rig(None, LENS)
    through = replace(truth, light_planes=(LightPlane(np.array([1.0, 0.0, 0.05]), 1e-6),))
    rig = held(through)
    state = boards_alone(rig).state
    task = EstimationTask.of_everything(rig, noise_model(rig, state), state)
    with pytest.raises(UntrustworthyError) as caught:
        determined(best_fit(task, with_sheets), "board")
    error = caught.value
    assert error.stage == "board"
    assert "passes through or near the camera's centre" in str(error)
    assert "the boards are" in str(error)
    assert "move the laser aside" in error.remedy


def test_warnings_of_boards_speak_of_boards() -> None:
    """Coarse detection and five coefficients of the lens leave some of these weak."""
    truth, views = seen_boards(np.random.default_rng(3), 8, 2.0)
    rig = rig_of(truth, without_lines(views), "brown")
    warnings = [w for w in calibrate(rig).warnings if "is known to" in w]
    assert warnings
    assert all(w.startswith("stage board: ") for w in warnings)
    assert not any(word in w for w in warnings for word in OF_RODS)
    assert all('distortion = "radial1"' in w for w in warnings if "distortion k" in w)


def test_fewer_coefficients_are_named_only_where_there_are_more() -> None:
    truth, views = seen_boards(np.random.default_rng(3), 3)
    for model, named in (("brown", True), ("radial2", True), ("radial1", False), ("none", False)):
        words = remedy(rig_of(truth, views, model), "camera", "camera.k1")
        assert ("radial1" in words) == named
    assert "radial1" not in remedy(rig_of(truth, views, "brown"), "camera", "camera.alpha")
    assert "radial1" not in remedy(rig_of(truth, views, "brown"), "plane", "sheet0.d")


def test_rods_keep_their_own_words() -> None:
    rig = paper_rig()
    seen = recorded(rig, RECORDING, np.random.default_rng(0))
    rods = Rig(rig.target, rig.camera.image_size, observations=seen)
    assert stage_of(rods, "camera") == "camera"
    assert stage_of(rods, "plane") == "plane"
    assert "swing the target" in remedy(rods, "camera")
    assert "lay the target" in remedy(rods, "plane")


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_a_known_camera_and_no_line_leave_nothing_to_calibrate(method: str) -> None:
    truth, views = seen_boards(np.random.default_rng(4), 6, 0.1)
    rig = replace(rig_of(truth, without_lines(views)), camera=truth.camera)
    error = refusal(rig, method)
    assert error.stage == "board"
    assert "no line of light was found on the boards" in str(error)
    assert "--camera" in error.remedy
