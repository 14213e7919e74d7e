"""The rig that all methods are given, and what each of them sees of it in a trial."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import Contestant
from sheetoflight.measurement.method_trial import Yardstick
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.camera import DISTORTION_MODELS, Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import board_poses
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.poses import (
    Recording,
    photographed,
    placed_targets,
    points_in_sheet,
    segments_in_sheet,
)
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views

_MARGIN_PX = 10.0
"""Noise must not take the ends of a length out of the picture."""

_POINTS = 200

_PLATES = folded_body(points=(6, 8), pitch_mm=20.0)
"""Two plates of 100 mm × 140 mm that meet at a ridge, 96 points in all."""

_LEAST_PIECE = 10
"""Points of a line's piece on a face below which nobody would look for it there."""

_TRAVEL_MM = 300.0
_TURNS = (1.0, 2.4)
"""Angles of the line on a plate to the sheet's first direction, rad, at which the plate's lit side
is seen, and lit, at 60° to its normal or less."""

_RODS = ("camera", "plane", "crossing")

_STREAMS = ("camera", "plane", "crossing", "board", "ends", "plate")
"""Random numbers of a trial: each stage has its own, so that methods that are given as many views
of a stage are given the same."""


@dataclass(frozen=True, eq=False)
class Contest:
    """What every trial needs.

    Parameters
    ----------
    options : ComparisonOptions
    truth : SimulatedRig
    yardstick : Yardstick
    """

    options: ComparisonOptions
    truth: SimulatedRig
    yardstick: Yardstick

    def stream(self, number: int, name: str) -> np.random.Generator:
        """Random numbers of a trial, whichever process makes it."""
        key = (number, _STREAMS.index(name))
        return np.random.default_rng(np.random.SeedSequence(self.options.seed, spawn_key=key))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a contestant is given in a trial.

    Parameters
    ----------
    rig : Rig
        What the method works on.
    camera : Rig, optional
        Pictures that tell the camera alone; it is calibrated from them first, and held.
    """

    rig: Rig
    camera: Rig | None = None


def contest(options: ComparisonOptions) -> Contest:
    """The rig, and the lengths that all calibrations of it are to measure."""
    truth = paper_rig(options.distortion)
    rng = np.random.default_rng(options.seed)
    points = points_in_sheet(truth, _POINTS, rng)
    ends = [
        segments_in_sheet(truth, mm, options.segments, rng, _MARGIN_PX) for mm in options.lengths
    ]
    uv = truth.camera.project(np.array(ends))
    return Contest(
        options, truth, Yardstick(truth.light_plane, points, np.array(options.lengths), uv)
    )


def simulated_evidence(
    plan: Contest, contestant: Contestant, number: int
) -> tuple[Evidence, Evidence]:
    """What a contestant sees in a trial, and the same views without noise."""
    views = plan.options.views(contestant)
    seen, exact = _targets_and_boards(plan, contestant, views, number)
    if "plate" not in views:
        return Evidence(seen), Evidence(exact)
    bare = _unseen(plan, None)
    steps = [
        replace(bare, observations=Observations(board=own))
        for own in _plates(plan, views["plate"], number)
    ]
    cameras = [replace(own, lasers=()) for own in (seen, exact)]
    return Evidence(steps[0], cameras[0]), Evidence(steps[1], cameras[1])


def _targets_and_boards(
    plan: Contest, contestant: Contestant, views: Mapping[str, int], number: int
) -> tuple[Rig, Rig]:
    """A rig with all of a contestant's views but those of a plate, with noise and without."""
    rods = [_rods(plan, stage, views[stage], number) for stage in _RODS if stage in views]
    seen, exact = (_joined([pair[which] for pair in rods]) for which in range(2))
    board = shown(contestant) if "board" in views else None
    if board is not None:
        boards = _boards(plan, board, views["board"], number, lit="plate" not in views)
        seen, exact = replace(seen, board=boards[0]), replace(exact, board=boards[1])
    rig = _unseen(plan, board)
    return replace(rig, observations=seen), replace(rig, observations=exact)


def _unseen(plan: Contest, board: Board | None) -> Rig:
    """The rig before anything of it is seen."""
    truth = plan.truth
    lens = _lens_model(plan.options.distortion)
    return Rig(truth.target, truth.camera.image_size, distortion=lens, board=board)


def shown(contestant: Contestant) -> Board | None:
    """What stage board shows."""
    return _PLATES if contestant.folded else contestant.board


def _rods(
    plan: Contest, stage: str, count: int, number: int
) -> tuple[tuple[str, Observations], tuple[str, Observations]]:
    """One stage's views of the rod, with noise and without."""
    rng = plan.stream(number, stage)
    camera, plane, crossing = (count * (stage == one) for one in ("camera", "plane", "crossing"))
    placed = placed_targets(plan.truth, Recording(camera, plane, crossing), rng)
    noisy = photographed(plan.truth.camera, placed, plan.options.pixel_std, rng)
    return (stage, noisy), (stage, photographed(plan.truth.camera, placed, 0.0, rng))


def _joined(stages: list[tuple[str, Observations]]) -> Observations:
    """The stages' views, each taken from observations of its own."""
    return Observations(**{stage: getattr(own, stage) for stage, own in stages})


def _boards(
    plan: Contest, board: Board, count: int, number: int, lit: bool
) -> tuple[BoardViews, BoardViews]:
    """Views of a board, with noise and without: with the line across it or, the laser being off,
    wherever the camera sees it."""
    rng, options = plan.stream(number, "board"), plan.options
    truth = replace(plan.truth, board=board)
    poses = board_poses(truth, board, count, rng, laser=0 if lit else None)
    shining = np.full((count, 1), lit)
    placed = placed_boards(truth, board, *poses, options.line_points, shining)
    see: Callable[..., BoardViews] = photographed_boards
    sizes = (options.pixel_std, options.line_noise)
    noisy, exact = see(truth.camera, placed, rng, *sizes), see(truth.camera, placed, rng)
    return _without_scraps(noisy), _without_scraps(exact)


def _without_scraps(views: BoardViews) -> BoardViews:
    """The views without pieces of the line that hardly touch a face."""
    pieces = [own for own in views.line.groups() if len(own) >= _LEAST_PIECE]
    kept = np.sort(np.concatenate([np.zeros(0, dtype=int), *pieces]))
    return replace(views, line=views.line.take(kept))


def _plates(plan: Contest, count: int, number: int) -> tuple[BoardViews, BoardViews]:
    """Ends of the line on a plate, a picture for each step of the stage, with noise and without."""
    rng = plan.stream(number, "plate")
    travel = np.linspace(-0.5, 0.5, count) * _TRAVEL_MM
    plate = SteppedPlate(travel_mm=travel.tolist(), turn=rng.uniform(*_TURNS))
    noisy = stepped_plate_views(plan.truth, plate, rng, plan.options.pixel_std)
    return noisy, stepped_plate_views(plan.truth, plate, rng)


def _lens_model(distortion: tuple[float, ...]) -> str:
    """The model of fewest coefficients that holds all that are not 0."""
    names = Camera.PARAMETERS[-len(distortion) :]
    needed = {name for name, value in zip(names, distortion, strict=True) if value}
    return next(model for model, free in DISTORTION_MODELS.items() if needed <= set(free))
