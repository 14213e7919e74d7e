"""The best of several minima: start from every camera worth trying until one is convincing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain

import numpy as np
from scipy.special import fdtri

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import Fit, settled
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.starts import (
    Evidence,
    cameras,
    evidence,
    pivoting_state,
    plain_cameras,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import Solution, SolverOptions
from sheetoflight.geometry.lines import on_common_line
from sheetoflight.model.rig import Rig

Completion = Callable[[Rig, Evidence | None, RigState], RigState]
"""Adds what the stages need beyond the pivoting targets to a starting state. The evidence of
collinear targets is absent where there are none."""

_CONVINCING_ODDS = 1e-4
"""A minimum is taken without trying other starts unless its residuals exceed what the targets'
straightness in the pictures says of the noise by more than chance does with these odds."""

_ROUGHLY = SolverOptions(tolerance=1e-2)
"""For what is only where the next adjustment begins."""

_BRIEFLY = SolverOptions(iterations=15)
"""For what either arrives soon or has gone astray."""

_AGREEING = 4
"""Starts that lead to one minimum before it is taken although it is not convincing: two have been
seen to meet in a false one."""

_SAME_MINIMUM = 1e-6
"""Relative difference of costs below which two starts have led to one minimum."""


def best_fit(task: EstimationTask, complete: Completion) -> Fit:
    """The fit of all shared parameters and poses from the best start.

    Whether it converged, and whether the views determine it, is for the caller to judge.

    Parameters
    ----------
    task : EstimationTask
    complete : callable
        Adds sheets and their views' poses to a starting state.

    Raises
    ------
    UntrustworthyError
        If there is no start.
    """
    best = _best_minimum(task, complete)
    return fitted(task.rig, task.stages, task.free, best.state, task.noise, task.blamed, best)


def _best_minimum(task: EstimationTask, complete: Completion) -> Solution[RigState]:
    if task.start is not None and not task.stages:
        return _from_boards(task, complete)
    found = evidence(task.rig)
    limit = _straightness_limit(task)
    best, cost, agreed, refusal = None, np.inf, 0, None
    for state in _starts(task, found, complete):
        if isinstance(state, UntrustworthyError):
            refusal = refusal or state
            continue
        try:
            solution = _minimum(task, state, limit)
        except UntrustworthyError as reason:
            refusal = refusal or reason
            continue
        same = abs(solution.cost - cost) <= _SAME_MINIMUM * cost
        better = not same and solution.cost < cost
        agreed = 1 if better else agreed + same
        if solution.cost < cost:
            best, cost = solution, solution.cost
        if cost <= limit or agreed == _AGREEING:
            break
    if best is None:
        raise refusal or UntrustworthyError(
            task.blamed, "no camera fits the views", "look for wrong detections"
        )
    return best


def _from_boards(task: EstimationTask, complete: Completion) -> Solution[RigState]:
    """Boards begin beside their minimum: near enough to tell the noise of their lines, by which
    they are adjusted then."""
    assert task.start is not None
    state = complete(task.rig, None, task.start)
    if len(task.rig.observations.board.line):
        return Solution.awaited(state)
    return settled(_adjustment(task, task.free, state), state, task.blamed)


def _starts(
    task: EstimationTask, found: Evidence, complete: Completion
) -> Iterator[RigState | UntrustworthyError]:
    """Starting states, or why a camera leads to none. Boards leave no doubt of the camera."""
    rig, boards = task.rig, task.start
    every = chain(cameras(rig, found), plain_cameras(rig))
    for camera in every if boards is None else (boards.camera,):
        try:
            state = pivoting_state(rig, found, camera)
            if boards is not None:
                state = state.with_poses("board", boards.poses["board"])
            yield complete(rig, found, state)
        except UntrustworthyError as refusal:
            yield refusal


def _minimum(task: EstimationTask, state: RigState, limit: float) -> Solution[RigState]:
    """Down from a start: all at once, which most often convinces; else first what follows from the
    camera, for depths that the camera's error has put far off would lead astray."""
    with suppress(UntrustworthyError):
        solution = _all_at_once(task, state, _BRIEFLY)
        if solution.converged and solution.cost <= limit:
            return solution
    held = settled(_adjustment(task, task.others, state), state, task.blamed, _ROUGHLY)
    return _all_at_once(task, held.state)


def _all_at_once(
    task: EstimationTask, state: RigState, options: SolverOptions | None = None
) -> Solution[RigState]:
    """Camera and everything else; what the lens adds to a camera, last."""
    pinhole = _adjustment(task, task.without_distortion, state)
    solution = settled(pinhole, state, task.blamed, options)
    if task.free == task.without_distortion:
        return solution
    return settled(_adjustment(task, task.free, state), solution.state, task.blamed, options)


def _adjustment(task: EstimationTask, free: tuple[str, ...], state: RigState) -> Adjustment:
    return task.noise.adjustment(task.rig, task.stages, free, state)


def _straightness_limit(task: EstimationTask) -> float:
    """Greatest cost that agrees with the noise of the markers across their common image line.

    That noise needs no calibration at all: three markers of a target are on a line.
    """
    markers = len(task.rig.target.markers_mm)
    squares, freedom = 0.0, 0
    for stage, views in task.stages.items():
        whole = views.seen[:, :markers].all(axis=1)
        uv, std = views.uv[whole, :markers], task.noise.std(stage)[whole, :markers]
        across = uv - on_common_line(uv)
        squares += float(np.sum((across / std[..., None]) ** 2))
        freedom += int(whole.sum()) * (markers - 2)
    own = task.noise.adjustment(task.rig, task.stages, task.free).degrees_of_freedom
    if freedom < 1 or own < 1:
        return -np.inf
    return 0.5 * own * squares / freedom * float(fdtri(own, freedom, 1.0 - _CONVINCING_ODDS))
