"""From a starting state to estimates, the sizes of the noise, and how well both are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sheetoflight.calibration.fit import Fit, settled
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.noise_sizes import (
    NO_SPREAD,
    disturbing,
    weighed,
    with_one_size,
    with_sizes,
)
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.estimation.block_least_squares import Solution
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_REDUCTIONS = 8


def fitted(
    rig: Rig,
    stages: Mapping[str, TargetViews],
    free: tuple[str, ...],
    state: RigState,
    noise: NoiseModel,
    stage: str,
    solution: Solution[RigState] | None = None,
) -> Fit:
    """Estimate the shared parameters ``free`` and all poses, and the free noise variances.

    Parameters
    ----------
    rig : Rig
    stages : mapping from stage to TargetViews
        The views to adjust.
    free : tuple of str
    state : RigState
        Where to begin.
    noise : NoiseModel
    stage : str
        What to blame in errors.
    solution : Solution, optional
        Of the estimates for independent image points, where it is known; or awaited, from a state
        so near to it that the residuals there tell the noise.

    Raises
    ------
    UntrustworthyError
        If a view does not determine its own pose, or there is no convergence.
    """
    adjustment = noise.adjustment(rig, stages, free, state)
    acting = disturbing(adjustment)
    sizes = noise.free & acting & (adjustment.degrees_of_freedom > 0)
    one = (acting & (sizes | (noise.variances > 0))).sum() == 1
    if solution is not None and not solution.found and (one or not sizes.any()):
        solution = None  # there is nothing to wait for
    if solution is None or (solution.found and adjustment.whiteners):
        solution = settled(adjustment, state, stage)
    fit = Fit(rig, adjustment, solution, noise, NO_SPREAD)
    if one and sizes.any():
        fit = with_one_size(fit, int(np.argmax(sizes)))
    elif sizes.any():
        fit = with_sizes(fit, sizes, stage)
    return _finished(fit, stage)


def _finished(fit: Fit, stage: str) -> Fit:
    """The fit at its minimum, of lines that were reduced near enough to it."""
    if not fit.solution.found:
        fit = replace(fit, solution=settled(fit.adjustment, fit.state, stage))
    for _ in range(_REDUCTIONS):
        if fit.adjustment.holds_at(fit.state):
            break
        adjustment = weighed(fit, fit.noise.variances, fit.state)
        solution = settled(adjustment, fit.state, stage)
        fit = replace(fit, adjustment=adjustment, solution=solution)
    return fit
