"""All methods of calibration on one simulated rig, trial by trial."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

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
    bound_mm,
    calibration_errors,
    measured_errors,
    plane_errors,
)
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.workflow.contest import Contest, Evidence, contest, shown, simulated_evidence
from sheetoflight.workflow.scheduled import spread_on_cluster
from sheetoflight.workflow.spread import ALONE, Execution, spread


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
    seen, exact = simulated_evidence(plan, contestant, number)
    views = (contestant.stages, shown(contestant), contestant.method == CAMERA_FREE)
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


def _calibrated(seen: Evidence, method: str) -> AnyCalibration:
    if method == CAMERA_FREE:
        return camera_free(seen.rig)
    if seen.camera is None:
        return calibrate(seen.rig, method)
    known = calibrate(seen.camera)
    held = replace(seen.rig, camera=known.camera, camera_covariance=known.covariance)
    return calibrate(held, method)


def _bound(plan: Contest, contestant: Contestant, exact: Evidence) -> Array:
    sizes = (plan.options.pixel_std, plan.options.line_noise)
    method = CAMERA_FREE if contestant.method == CAMERA_FREE else "joint"
    bounding = bounding_calibration(exact.rig, *sizes, method, exact.camera)
    return bound_mm(bounding, plan.yardstick)


def _end_std(plan: Contest) -> float | None:
    """Ends seen as well as the markers are taken to be as the calibration says of these."""
    return plan.options.end_std


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
