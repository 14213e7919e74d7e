"""The best of several minima: start from every camera worth trying until one is convincing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import chain

import numpy as np
from scipy.special import fdtri

from sheetoflight.calibration.fitting import Fit, fitted, settled
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import RigState, intrinsic_names
from sheetoflight.calibration.starts import (
    Evidence,
    cameras,
    evidence,
    pivoting_state,
    plain_cameras,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import SolverOptions
from sheetoflight.geometry.lines import on_common_line
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

Completion = Callable[[Rig, Evidence, RigState], RigState]
"""Adds what the stages need beyond the pivoting targets to a starting state."""

_CONVINCING_ODDS = 1e-4
"""A minimum is taken without trying other starts unless its residuals exceed what the targets'
straightness in the pictures says of the noise by more than chance does with these odds."""

_ROUGHLY = SolverOptions(tolerance=1e-2)
"""For what is only where the next adjustment begins."""

_SAME_MINIMUM = 1e-6
"""Relative difference of costs below which two starts have led to one minimum."""


def best_fit(
    rig: Rig,
    noise: NoiseModel,
    stages: Mapping[str, TargetViews],
    others: tuple[str, ...],
    complete: Completion,
    stage: str,
) -> Fit:
    """The fit of camera, poses and the shared parameters ``others``, from the best start.

    Whether it converged, and whether the views determine it, is for the caller to judge.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    stages : mapping from stage to TargetViews
    others : tuple of str
        Shared parameters beside the camera's.
    complete : callable
        Adds sheets and their views' poses to a starting state.
    stage : str
        What to blame where nothing fits.

    Raises
    ------
    UntrustworthyError
        If there is no start.
    """
    first = _best_pinhole(rig, noise, stages, others, complete, stage)
    whole = (*intrinsic_names(rig.free_intrinsics), *others)
    return fitted(rig, stages, whole, first, noise, stage)


def _best_pinhole(
    rig: Rig,
    noise: NoiseModel,
    stages: Mapping[str, TargetViews],
    others: tuple[str, ...],
    complete: Completion,
    stage: str,
) -> RigState:
    found = evidence(rig)
    pinhole = [name for name in rig.free_intrinsics if name not in Camera.PARAMETERS[5:]]
    free = (*intrinsic_names(pinhole), *others)
    limit = _straightness_limit(rig, noise, stages, free)
    best, cost, refusal = None, np.inf, None
    for state in _starts(rig, found, complete):
        if isinstance(state, UntrustworthyError):
            refusal = refusal or state
            continue
        # first what follows from the camera, then all: depths that the camera's error has put
        # far off would lead astray
        try:
            held = settled(noise.adjustment(rig, stages, others, state), state, stage, _ROUGHLY)
            solution = settled(noise.adjustment(rig, stages, free, state), held.state, stage)
        except UntrustworthyError as reason:
            refusal = refusal or reason
            continue
        again = abs(solution.cost - cost) <= _SAME_MINIMUM * cost
        if solution.cost < cost:
            best, cost = solution.state, solution.cost
        if cost <= limit or again:
            break
    if best is None:
        raise refusal or UntrustworthyError(
            stage, "no camera fits the views", "look for wrong detections"
        )
    return best


def _starts(
    rig: Rig, found: Evidence, complete: Completion
) -> Iterator[RigState | UntrustworthyError]:
    """Starting states, or why a camera leads to none."""
    for camera in chain(cameras(rig, found), plain_cameras(rig)):
        try:
            yield complete(rig, found, pivoting_state(rig, found, camera))
        except UntrustworthyError as refusal:
            yield refusal


def _straightness_limit(
    rig: Rig, noise: NoiseModel, stages: Mapping[str, TargetViews], free: tuple[str, ...]
) -> float:
    """Greatest cost that agrees with the noise of the markers across their common image line.

    That noise needs no calibration at all: three markers of a target are on a line.
    """
    markers = len(rig.target.markers_mm)
    squares, freedom = 0.0, 0
    for stage, views in stages.items():
        whole = views.seen[:, :markers].all(axis=1)
        uv, std = views.uv[whole, :markers], noise.std(stage)[whole, :markers]
        across = uv - on_common_line(uv)
        squares += float(np.sum((across / std[..., None]) ** 2))
        freedom += int(whole.sum()) * (markers - 2)
    own = noise.adjustment(rig, stages, free).degrees_of_freedom
    if freedom < 1 or own < 1:
        return -np.inf
    return 0.5 * own * squares / freedom * float(fdtri(own, freedom, 1.0 - _CONVINCING_ODDS))
