"""Rigs with both kinds of evidence, and a second opinion, that tests share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sheetoflight.model.rig import Rig
from sheetoflight.model.second_opinion import (
    Agreement,
    Opinion,
    ScaleDifference,
    SecondOpinion,
    SheetAgreement,
)
from sheetoflight.simulation.board_faults import scaled_board
from sheetoflight.simulation.board_poses import SHEET_OF_PAPER, board_poses, board_rig
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.poses import Recording, recorded
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.boards import LENS, rig_of


def rod_and_board(
    seed: int, noise: float = 0.1, board_size: float = 1.0, crossing_views: int = 0
) -> tuple[SimulatedRig, Rig]:
    """The paper's rig with rod and board, the board in truth `board_size` times as large as is
    told, and what a person would know of it."""
    rng = np.random.default_rng(seed)
    truth = board_rig(None, LENS)
    board = scaled_board(SHEET_OF_PAPER, board_size)
    poses = board_poses(truth, board, 8, rng)
    boards = observed_boards(truth, board, *poses, rng, noise, noise, 100)
    rod = recorded(truth, Recording(30, 10, crossing_views, noise), rng)
    return truth, replace(rig_of(truth, boards), observations=replace(rod, board=boards))


def opinion(**changes: Any) -> SecondOpinion:
    """Rod and board that agree, but for the changes."""
    same: dict[str, Any] = {
        "rod": Opinion("rod", 40, ("camera", "laser")),
        "board": Opinion("board", 8, ("camera", "laser")),
        "parameters": (
            Agreement("camera.alpha", 6896.1 / 3, 2299.1, 1.2),
            Agreement("laser.d", 562.3, 562.4, 0.3),
        ),
        "chi2": 4.1 / 3,
        "degrees_of_freedom": 4,
        "noise_freedom": 311.7,
        "odds": 0.85,
        "sheets": (SheetAgreement("laser", 22, 830.1, 1460.6, 1.1, 1.4, 2.1 / 3),),
        "scale": ScaleDifference(1e-4 / 3, 1e-4, 0.74, 0.8),
    }
    return SecondOpinion(**(same | changes))


TOO_LARGE = ScaleDifference(1.0 / 1.01 - 1.0, 1e-4, 1e-12, 0.4)
"""The board is 1 % larger than stated, all else agrees."""
