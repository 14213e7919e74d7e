"""Monte Carlo and stated uncertainties of rigs with boards.

What is tolerated, and the odds of failing by chance, are those of test_monte_carlo.py: below 1 in
100 for each rig, were linear theory exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.methods import CalibrationOptions, calibrate
from sheetoflight.measurement.monte_carlo import experiment, summarised, trial
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.monte_carlo import MonteCarlo
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from sheetoflight.simulation.poses import observed_rig
from tests.calibration.boards import LENS, rig_of, seen_boards, without_lines

BOARD = PlanarBoard("chessboard", 8, 6, (28.0, 28.0))
PRINTED_MM = 0.03


def boards(views: int = 12, seed: int = 20, **known: float) -> Rig:
    """Boards with the line across them; what is known of the board beside its pattern."""
    board = replace(BOARD, **known)
    truth, seen = seen_boards(np.random.default_rng(seed), views, 0.1, 0.2, board, line_points=80)
    return rig_of(truth, seen)


def camera_alone() -> Rig:
    """Boards with the laser off."""
    rig = boards()
    views = without_lines(rig.observations.board)
    return replace(rig, observations=Observations(board=views))


def held_camera() -> Rig:
    """Four boards, and the camera known from others."""
    known = calibrate(boards(seed=21))
    return replace(boards(4), camera=known.camera, camera_covariance=known.covariance)


def mixed() -> Rig:
    """A rod and a board before one camera."""
    rng = np.random.default_rng(22)
    truth, seen = seen_boards(rng, 8, 0.1, 0.2, BOARD, line_points=80)
    rods = observed_rig(truth, 20, 8, 0.1, rng)
    return replace(rig_of(truth, seen), target=truth.target, observations=replace(rods, board=seen))


def printed() -> Rig:
    """Boards whose points are 0.03 mm off, the same ones in all views."""
    rng = np.random.default_rng(23)
    truth = board_rig(BOARD, LENS)
    poses = board_poses(truth, BOARD, 12, rng)
    placed = placed_boards(truth, BOARD, *poses, line_points=80)
    off = BOARD.points + PRINTED_MM * rng.standard_normal(BOARD.points.shape)
    points = off @ np.swapaxes(poses[0], 1, 2) + poses[1][:, None]
    views = photographed_boards(truth.camera, replace(placed, points=points), rng, 0.1, 0.2)
    return rig_of(truth, views)


RIGS: dict[str, Callable[[], Rig]] = {
    "boards": boards,
    "uncertain size": lambda: boards(scale_std=0.002),
    "stated noise": lambda: replace(boards(), pixel_std=0.1),
    "camera alone": camera_alone,
    "held camera": held_camera,
    "rods and boards": mixed,
}


def checked(rig: Rig, trials: int, method: str = "joint") -> MonteCarlo:
    """The Monte Carlo of a rig's calibration."""
    calibration = calibrate(rig, method)
    plan = experiment(rig, calibration, CalibrationOptions())
    return summarised(plan, calibration, [trial((plan, i)) for i in range(trials)])


@pytest.mark.parametrize("case", ["uncertain size", "held camera"])
def test_it_agrees_in_short(case: str) -> None:
    found = checked(RIGS[case](), 100)
    assert found.agrees, found.verdict
    assert len(found.parameters) == 10
    assert len(found.lengths) >= 9


@pytest.mark.accuracy
@pytest.mark.parametrize("case", list(RIGS))
def test_it_agrees(case: str) -> None:
    found = checked(RIGS[case](), 1000)
    assert found.agrees, found.verdict


@pytest.mark.accuracy
def test_it_agrees_by_method_two_step() -> None:
    found = checked(boards(), 1000, "two-step")
    assert found.agrees, found.verdict


@pytest.mark.accuracy
def test_of_badly_printed_boards_the_stated_uncertainty_is_on_the_safe_side() -> None:
    """The size of the points' noise holds the print too, which so counts twice."""
    found = checked(printed(), 400)
    for one in found.parameters:
        assert 0.75 < one.std_ratio < 1.05 + 4.0 * one.std_ratio_std, one.difference
        assert one.coverage > 0.95 - 0.012 - 4.0 * one.coverage_std, one.difference
