"""Rigs whose boards are simulated, for the tests of the adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.rig import SimulatedRig

LENS = (-0.1, 0.05, 0.0, 0.0, 0.0)


def seen_boards(
    rng: np.random.Generator,
    views: int = 12,
    pixel_std: float = 0.0,
    line_std: float = 0.0,
    board: Board | None = None,
    line_points: int = 200,
    distortion: tuple[float, float, float, float, float] = LENS,
) -> tuple[SimulatedRig, BoardViews]:
    """A simulated rig, and what is seen of its board held across the sheet."""
    truth = board_rig(board, distortion)
    held = truth.board
    assert held is not None
    poses = board_poses(truth, held, views, rng)
    return truth, observed_boards(truth, held, *poses, rng, pixel_std, line_std, line_points)


def rig_of(truth: SimulatedRig, views: BoardViews, distortion: str = "radial2") -> Rig:
    """What the person who calibrates knows."""
    return Rig(
        CollinearTarget(),
        truth.camera.image_size,
        distortion,
        board=truth.board,
        observations=Observations(board=views),
    )


def without_lines(views: BoardViews) -> BoardViews:
    """The views with the laser off."""
    return replace(views, line=views.line.take(np.zeros(len(views.line), dtype=bool)))
