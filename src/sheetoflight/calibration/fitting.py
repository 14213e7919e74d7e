"""From a starting state to estimates, the sizes of the noise, and how well both are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, fdtrc

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.noise import PIXEL, PLACEMENT, NoiseModel
from sheetoflight.calibration.pose_reselection import reselected
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import (
    Solution,
    SolverOptions,
    scaled_inverse,
    solve,
)
from sheetoflight.estimation.variance_components import (
    Contrasts,
    ReducedModel,
    excess,
    reduced_model,
    variance_components,
)
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_RESELECTIONS = 5
_NOISE_ROUNDS = 8
_SETTLED = 0.01
"""Relative change of a standard deviation below which the weights are not renewed: the estimates
depend on errors of the weights in second order only."""

_SHOWN = 1.96
"""Standard deviations by which the residuals must ask for offsets of the target from the sheet:
with two kinds of offset, one rig in twenty without any is taken to have some."""

_SHOWN_ODDS = 0.025
"""Odds of the in-plane views' larger scatter by chance at which they show offsets."""


@dataclass(frozen=True)
class Fit:
    """A minimum, the adjustment it belongs to, and the noise that its residuals show.

    Parameters
    ----------
    rig : Rig
    adjustment : Adjustment
    solution : Solution
    noise : NoiseModel
        With the estimated variances in place.
    size_covariance : (3, 3) array
        Of the estimated variances; zero where they were stated.
    """

    rig: Rig
    adjustment: Adjustment
    solution: Solution[RigState]
    noise: NoiseModel
    size_covariance: Array

    @property
    def state(self) -> RigState:
        """The estimates."""
        return self.solution.state

    @property
    def chi2(self) -> float:
        """Sum of squared residuals in units of the noise that the adjustment was given."""
        return 2.0 * self.solution.cost

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less unknowns."""
        return self.adjustment.degrees_of_freedom

    @cached_property
    def contrasts(self) -> list[Contrasts]:
        """The residuals with each view's pose eliminated, stage by stage."""
        return self.noise.contrasts(self.adjustment, self.state, {})

    @cached_property
    def information(self) -> Array:
        """On the shared parameters, all poses eliminated."""
        size = self.adjustment.shared_size
        return reduced_model(self.contrasts, size, self.noise.variances).information

    @cached_property
    def covariance(self) -> Array:
        """Of the shared parameters.

        Raises
        ------
        numpy.linalg.LinAlgError
            If they are undetermined.
        """
        return scaled_inverse(self.information)[0]

    def model(self, moves: Mapping[str, list[Array]] | None = None) -> ReducedModel:
        """Information on the shared parameters, and on further moves of the points behind them."""
        moves = moves or {}
        extra = max((len(m) for m in moves.values()), default=0)
        groups = (
            self.noise.contrasts(self.adjustment, self.state, moves) if moves else self.contrasts
        )
        return reduced_model(groups, self.adjustment.shared_size + extra, self.noise.variances)


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
        Of the estimates for independent image points, where it is known.

    Raises
    ------
    UntrustworthyError
        If a view does not determine its own pose, or there is no convergence.
    """
    adjustment = noise.adjustment(rig, stages, free, state)
    if solution is None or adjustment.whiteners:
        solution = settled(adjustment, state, stage)
    sizes = _only(noise, stages)
    if not sizes.any() or adjustment.degrees_of_freedom < 1:
        return Fit(rig, adjustment, solution, noise, np.zeros((3, 3)))
    weights_change = "plane" in stages and noise.variances[PLACEMENT:].any()
    if not (sizes[PLACEMENT:].any() or weights_change):
        return _with_pixel_noise(Fit(rig, adjustment, solution, noise, np.zeros((3, 3))))
    return _with_components(rig, adjustment, solution, noise, sizes, stage)


def _only(noise: NoiseModel, stages: Mapping[str, TargetViews]) -> np.ndarray:
    """Free components that these stages can tell."""
    there = np.array([True, "plane" in stages, "plane" in stages])
    return noise.free & there


def _with_pixel_noise(fit: Fit) -> Fit:
    """The only unknown size is that of the pixel noise: no weight changes with it."""
    freedom = fit.degrees_of_freedom
    variance = fit.noise.variances[PIXEL] * fit.chi2 / freedom
    variances = fit.noise.variances.copy()
    variances[PIXEL] = variance
    spread = np.zeros((3, 3))
    spread[PIXEL, PIXEL] = 2.0 * variance**2 / freedom
    sized = replace(fit, noise=fit.noise.with_variances(variances), size_covariance=spread)
    if "contrasts" in vars(fit):  # they do not depend on the sizes, and cost an evaluation
        vars(sized)["contrasts"] = fit.contrasts
    return sized


def _with_components(
    rig: Rig,
    adjustment: Adjustment,
    solution: Solution[RigState],
    noise: NoiseModel,
    free: np.ndarray,
    stage: str,
) -> Fit:
    """Residuals tell the noise, the noise weighs the residuals, until both agree."""
    variances = noise.variances.copy()
    if free[PIXEL]:
        variances[PIXEL] *= max(2.0 * solution.cost / adjustment.degrees_of_freedom, 1e-12)
    if free[PLACEMENT:].any():
        fit = Fit(rig, adjustment, solution, noise, np.zeros((3, 3)))
        free = free & _asked_for(fit, variances, free)
        if not free[PLACEMENT:].any():
            return _with_pixel_noise(fit) if free[PIXEL] else fit
    start = _first_offsets(noise, adjustment, solution.state, variances, free)
    spread = np.zeros((3, 3))
    for _ in range(_NOISE_ROUNDS):
        groups = noise.contrasts(adjustment, solution.state, {})
        try:
            found = variance_components(groups, adjustment.shared_size, start, free)
        except np.linalg.LinAlgError:  # undetermined, which is for others to tell
            break
        spread = found.covariance
        settled_now = np.allclose(np.sqrt(found.sizes), np.sqrt(variances), rtol=_SETTLED, atol=0.0)
        variances = start = found.sizes
        if settled_now:
            break
        weighted = noise.with_variances(variances)
        adjustment = weighted.adjustment(
            rig, adjustment.stages, adjustment.parameters, solution.state
        )
        solution = settled(adjustment, solution.state, stage)
    return Fit(rig, adjustment, solution, noise.with_variances(variances), spread)


def _asked_for(fit: Fit, variances: Array, free: np.ndarray) -> np.ndarray:
    """Components to estimate: each kind of offset from the sheet only where the residuals show it,
    the second beside the first.

    A variance that can only be positive would else, where there is none, be found too large.
    """
    groups, size = fit.contrasts, fit.adjustment.shared_size
    asked = np.arange(len(free)) == PIXEL
    try:
        strength = np.where(free & ~asked, excess(groups, size, variances, free), -np.inf)
        first = int(np.argmax(strength))
        if strength[first] <= _SHOWN and not _scatters_more(
            fit.adjustment, groups, variances, free
        ):
            return asked
        asked[first] = True
        start = _first_offsets(fit.noise, fit.adjustment, fit.state, variances, free & asked)
        sizes = variance_components(groups, size, start, free & asked).sizes
        return asked | (excess(groups, size, sizes, free & asked) > _SHOWN)
    except np.linalg.LinAlgError:
        return asked


def _scatters_more(
    adjustment: Adjustment, groups: Sequence[Contrasts], variances: Array, free: np.ndarray
) -> bool:
    """Whether the in-plane views scatter more than the others, whichever way their markers move
    most: the score weighs those of large image motion, of which there may be few."""
    squares, counts = {}, {}
    for stage, group in zip(adjustment.stages, groups, strict=True):
        inverse = np.linalg.inv(group.covariance(variances * (np.arange(len(free)) == PIXEL)))
        squares[stage] = float(np.einsum("ni,nij,nj->", group.values, inverse, group.values))
        seen = int(adjustment.stages[stage].seen.sum())
        counts[stage] = 2 * seen - LOCAL_SIZE[stage] * len(group.values)
    own = sum(name.startswith("sheet") for name in adjustment.parameters)
    lying = counts["plane"] - own
    rest = adjustment.degrees_of_freedom - lying
    if lying < 1:
        return False
    if not free[PIXEL]:
        return float(chdtrc(lying, squares["plane"])) < _SHOWN_ODDS
    if rest < 1:
        return False
    others = max(sum(squares.values()) - squares["plane"], 1e-300)
    return float(fdtrc(lying, rest, squares["plane"] / lying / (others / rest))) < _SHOWN_ODDS


def _first_offsets(
    noise: NoiseModel, adjustment: Adjustment, state: RigState, variances: Array, free: np.ndarray
) -> Array:
    """Variances at which placement and pixel noise are alike, as a start."""
    start = variances.copy()
    for component, part in noise.parts(adjustment, state, "plane"):
        if component != PIXEL and free[component]:
            per_mm = float(np.trace(part, axis1=1, axis2=2).mean()) / part.shape[-1]
            start[component] = variances[PIXEL] / max(per_mm, 1e-12)
    return start


def settled(
    adjustment: Adjustment, state: RigState, stage: str, options: SolverOptions | None = None
) -> Solution[RigState]:
    """Solve; test views for another pose, and solve again until none changes."""
    solution = _solved(adjustment, state, stage, options)
    for _ in range(_RESELECTIONS):
        state, changed = reselected(solution.state, adjustment.stages, adjustment.positions)
        if not changed:
            break
        again = _solved(adjustment, state, stage, options)
        if again.cost >= solution.cost:
            break
        solution = again
    return solution


def _solved(
    adjustment: Adjustment, state: RigState, stage: str, options: SolverOptions | None
) -> Solution[RigState]:
    try:
        return solve(adjustment, state, options)
    except np.linalg.LinAlgError as reason:
        raise _no_pose(adjustment, state, stage) from reason


def _no_pose(adjustment: Adjustment, state: RigState, stage: str) -> UntrustworthyError:
    """The refusal of a view whose own parameters are open."""
    who = "a view"
    for name, block in zip(adjustment.stages, adjustment.blocks(state), strict=True):
        singular = np.linalg.matrix_rank(block.by_local) < block.by_local.shape[2]
        if singular.any():
            stage = name
            who = f"view {adjustment.stages[name].names[int(np.argmax(singular))]}"
            break
    return UntrustworthyError(
        stage,
        f"{who} does not determine its own pose",
        "remove views with fewer than two markers, or with markers that coincide",
    )


def undetermined(stage: str) -> UntrustworthyError:
    """The views leave something open that was to be estimated."""
    return UntrustworthyError(
        stage,
        "the views do not determine the parameters",
        "take further views with the target turned into other directions",
    )
