"""All methods of calibration on one simulated rig, trial by trial."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sheetoflight.calibration.camera_free_method import camera_free
from sheetoflight.calibration.methods import CAMERA_FREE, calibrate
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.atomic import write_whole
from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import Contestant
from sheetoflight.measurement.cramer_rao import bounding_calibration
from sheetoflight.measurement.method_comparison import MethodComparison, compared
from sheetoflight.measurement.method_trial import (
    Attempt,
    Yardstick,
    bound_mm,
    calibration_errors,
    measured_errors,
    plane_errors,
)
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.calibration import AnyCalibration
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
from sheetoflight.workflow.scheduled import spread_on_cluster
from sheetoflight.workflow.spread import ALONE, Execution, spread

_MARGIN_PX = 10.0
"""Noise must not take the ends of a length out of the picture."""

_POINTS = 200

_PLATES = folded_body(points=(6, 8), pitch_mm=20.0)
"""Two plates of 100 mm × 140 mm that meet at a ridge, 96 points in all."""

_LEAST_PIECE = 10
"""Points of a line's piece on a face below which nobody would look for it there."""

_STREAMS = ("camera", "plane", "crossing", "board", "ends")
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


def compare(
    options: ComparisonOptions | None = None, run: Execution = ALONE, scheduler: str | None = None
) -> MethodComparison:
    """Methods of calibration side by side on the paper's rig.

    Every trial takes new views with new noise and gives them to all methods; lengths are measured
    at the same places in all trials. But for the times, the result does not depend on where the
    trials are made.

    Parameters
    ----------
    options : ComparisonOptions, optional
    run : Execution
    scheduler : str, optional
        Address of a dask scheduler whose workers make the trials, in place of this machine's
        processes.

    Raises
    ------
    InputError
        If the rig cannot be simulated so, or the scheduler does not answer.
    UntrustworthyError
        If no method has a result in any trial.
    """
    plan = contest(options or ComparisonOptions())
    tasks = [(plan, number) for number in range(plan.options.trials)]
    if scheduler is None:
        trials = spread(trial, tasks, "compare", run)
    else:
        trials = spread_on_cluster(scheduler, trial, tasks, "compare", run)
    return compared(plan.options, list(trials))


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


def trial(task: tuple[Contest, int]) -> tuple[Attempt, ...]:
    """One trial of all methods; a method's refusal is kept in its own words."""
    plan, number = task
    end_noise = plan.options.end_noise
    noise = plan.stream(number, "ends").normal(scale=end_noise, size=plan.yardstick.uv.shape)
    bounds: dict[object, Array] = {}
    return tuple(
        _attempt(plan, contestant, number, noise, bounds) for contestant in plan.options.contestants
    )


def _attempt(
    plan: Contest, contestant: Contestant, number: int, noise: Array, bounds: dict[object, Array]
) -> Attempt:
    """One method; its bound is kept for those that are given the same views."""
    seen, exact = simulated_rigs(plan, contestant, number)
    views = (contestant.stages, _shown(contestant), contestant.method == CAMERA_FREE)
    try:
        started = time.perf_counter()
        calibration = _calibrated(seen, contestant.method)
        seconds = time.perf_counter() - started
        if views not in bounds:
            bounds[views] = _bound(plan, contestant, exact)
        angle, distance = plane_errors(calibration, plan.yardstick)
        return Attempt(
            contestant.name,
            seconds=seconds,
            normal_deg=angle,
            plane_mm=distance,
            calibration=calibration_errors(calibration, plan.yardstick),
            measured=measured_errors(calibration, plan.yardstick, noise, _end_std(plan)),
            bound_mm=bounds[views],
        )
    except (InputError, UntrustworthyError) as refusal:
        return Attempt(contestant.name, refused=str(refusal))


def _calibrated(rig: Rig, method: str) -> AnyCalibration:
    return camera_free(rig) if method == CAMERA_FREE else calibrate(rig, method)


def _bound(plan: Contest, contestant: Contestant, exact: Rig) -> Array:
    sizes = (plan.options.pixel_std, plan.options.line_noise)
    method = CAMERA_FREE if contestant.method == CAMERA_FREE else "joint"
    return bound_mm(bounding_calibration(exact, *sizes, method), plan.yardstick)


def _end_std(plan: Contest) -> float | None:
    """Ends seen as well as the markers are taken to be as the calibration says of these."""
    return plan.options.end_std


def simulated_rigs(plan: Contest, contestant: Contestant, number: int) -> tuple[Rig, Rig]:
    """A contestant's rig as it is seen in a trial, and the same views without noise."""
    options, truth = plan.options, plan.truth
    views = options.views(contestant)
    pairs = [
        _rods(plan, stage, count, number) for stage, count in views.items() if stage != "board"
    ]
    seen, exact = (_joined([pair[which] for pair in pairs]) for which in range(2))
    board = _shown(contestant)
    if board is not None and "board" in views:
        boards = _boards(plan, board, views["board"], number)
        seen, exact = (
            replace(rods, board=own) for rods, own in zip((seen, exact), boards, strict=True)
        )
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        distortion=_lens_model(options.distortion),
        board=board if "board" in views else None,
    )
    return replace(rig, observations=seen), replace(rig, observations=exact)


def _shown(contestant: Contestant) -> Board | None:
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


def _boards(plan: Contest, board: Board, count: int, number: int) -> tuple[BoardViews, BoardViews]:
    """Views of a board with the line across it, with noise and without."""
    rng, options = plan.stream(number, "board"), plan.options
    truth = replace(plan.truth, board=board)
    poses = board_poses(truth, board, count, rng)
    placed = placed_boards(truth, board, *poses, line_points=options.line_points)
    see: Callable[..., BoardViews] = photographed_boards
    sizes = (options.pixel_std, options.line_noise)
    noisy, exact = see(truth.camera, placed, rng, *sizes), see(truth.camera, placed, rng)
    return _without_scraps(noisy), _without_scraps(exact)


def _without_scraps(views: BoardViews) -> BoardViews:
    """The views without pieces of the line that hardly touch a face."""
    pieces = [own for own in views.line.groups() if len(own) >= _LEAST_PIECE]
    kept = np.sort(np.concatenate([np.zeros(0, dtype=int), *pieces]))
    return replace(views, line=views.line.take(kept))


def _lens_model(distortion: tuple[float, ...]) -> str:
    """The model of fewest coefficients that holds all that are not 0."""
    names = Camera.PARAMETERS[-len(distortion) :]
    needed = {name for name, value in zip(names, distortion, strict=True) if value}
    return next(model for model, free in DISTORTION_MODELS.items() if needed <= set(free))


def write_comparison_page(
    path: str | Path, comparison: MethodComparison, times: bool = False
) -> None:
    """Write a comparison as one self-contained HTML page, whole or not at all.

    Parameters
    ----------
    path : str or Path
    comparison : MethodComparison
    times : bool
        Whether to show how long calibrations took, which differs from run to run.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    from sheetoflight.report.comparison_page import build_comparison_page

    write_whole(path, build_comparison_page(comparison, times))
