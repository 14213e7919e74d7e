"""The methods that are compared: which stages each is given, and how it is calibrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sheetoflight.model.board import Board, PlanarBoard

_SHEET_OF_PAPER = PlanarBoard("chessboard", 11, 8, (20.0, 20.0))
"""A chessboard of 12 × 9 fields that fills a sheet of A4."""

_SHARE_OF_BOARDS = 0.5
"""Of the pictures of a contestant that is given a rod and a board."""


@dataclass(frozen=True)
class Contestant:
    """A method of calibration, and the pictures that it works on.

    Parameters
    ----------
    name : str
        What it is called on the command line and in tables.
    method : str
        Of `calibration.methods.calibrate`, or ``camera-free``.
    stages : tuple of str
        Which stages are recorded, of camera, plane, crossing, board and plate. A plate is a bare
        one that a stage moves: its points tell the sheet once the camera is known, which is
        calibrated first, from the other stages, and held.
    board : Board, optional
        What stage board shows; the laser is off where there is a plate.
    folded : bool
        Whether it shows two plates that meet at a ridge, in place of a board.
    """

    name: str
    method: str
    stages: tuple[str, ...]
    board: Board | None = None
    folded: bool = False

    def views(self, pictures: int, camera_share: float) -> dict[str, int]:
        """How many pictures each of its stages has, of so many together.

        Half of them show the board where there are a rod and a board. Of the others the
        `camera_share` goes to the stage that tells the camera alone, which is stage camera, or
        the board where there is a plate; the rest is shared evenly.
        """
        if "plate" in self.stages:
            shares = {"board": camera_share}
        else:
            shares = {"board": _SHARE_OF_BOARDS, "camera": camera_share}
        open_stages, left = list(self.stages), pictures
        counts: dict[str, int] = {}
        for stage, share in shares.items():
            if stage in open_stages and len(open_stages) > 1:
                counts[stage] = round(share * left)
                left -= counts[stage]
                open_stages.remove(stage)
        for place, stage in enumerate(open_stages):
            counts[stage] = left // (len(open_stages) - place)
            left -= counts[stage]
        return {stage: counts[stage] for stage in self.stages}


CONTESTANTS: Mapping[str, Contestant] = MappingProxyType(
    {
        one.name: one
        for one in (
            Contestant("rod-joint", "joint", ("camera", "plane")),
            Contestant("rod-two-step", "two-step", ("camera", "plane")),
            Contestant("rod-paper", "paper", ("camera", "plane")),
            Contestant("crossing-joint", "joint", ("camera", "crossing")),
            Contestant("crossing-two-step", "two-step", ("camera", "crossing")),
            Contestant("camera-free", "camera-free", ("plane",)),
            Contestant("board-joint", "joint", ("board",), _SHEET_OF_PAPER),
            Contestant("board-two-step", "two-step", ("board",), _SHEET_OF_PAPER),
            Contestant("board-planar-lines", "planar-lines", ("board",), _SHEET_OF_PAPER),
            Contestant("board-cross-ratio", "cross-ratio", ("board",), _SHEET_OF_PAPER),
            Contestant("solid-joint", "joint", ("board",), folded=True),
            Contestant("solid-cross-ratio", "cross-ratio", ("board",), folded=True),
            Contestant("solid-zigzag", "zigzag", ("board",), folded=True),
            Contestant("self-generated", "self-generated", ("board", "plate"), _SHEET_OF_PAPER),
            Contestant("rod-and-board", "joint", ("camera", "plane", "board"), _SHEET_OF_PAPER),
        )
    }
)
"""All that can be compared, by name; a row more is all that a further method needs."""

PRINTED_MM: Mapping[str, Mapping[float, float]] = MappingProxyType(
    {
        "crossing-two-step": {20.0: 0.45 / 3, 40.0: 0.28, 60.0: 0.39},
        "rod-paper": {20.0: 0.02 / 3, 40.0: 0.065, 60.0: 0.03},
    }
)
"""Mean absolute errors by length that the paper prints: Table 3, which is its Ref. 21, a target
crossing the sheet, and Table 4, its own method. Three segments of 20 mm, two of 40, one of 60."""

PAPER_CASE = ("crossing-two-step", "rod-paper", "crossing-joint", "rod-joint")
"""The two that the paper compares, then what else the same pictures give."""
