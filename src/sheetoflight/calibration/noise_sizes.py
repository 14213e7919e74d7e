"""The sizes of the noise that the residuals of a fit show, and the fit with these weights.

Offsets of targets and lines from their sheets, and windings of lines, are taken only where the
residuals ask for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc, fdtrc

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.components import (
    COMPONENTS,
    CORNER,
    LINE,
    MARKER,
    PIXEL,
    PLACEMENT,
    SHAPE,
    STRIPE,
)
from sheetoflight.calibration.fit import Fit, settled
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.estimation.variance_components import (
    Contrasts,
    VarianceComponents,
    excess,
    variance_components,
)
from sheetoflight.geometry.directions import Array

_OFFSETS = (PLACEMENT, MARKER, LINE, SHAPE)
"""Components that are estimated only where the residuals ask for them: all else is always there."""

_IS_SHAPE = np.arange(len(COMPONENTS)) == SHAPE

_IS_OFFSET = np.isin(np.arange(len(COMPONENTS)), _OFFSETS)

NO_SPREAD = np.zeros((len(COMPONENTS), len(COMPONENTS)))

_NOISE_ROUNDS = 8

_SETTLED = 0.01
"""Relative change of a standard deviation below which the weights are not renewed: the estimates
depend on errors of the weights in second order only."""

_WELL_KNOWN = 1e-3
"""Last step of the variances, in standard uncertainties of them, after which they are as well
known as these residuals can tell."""

_SHOWN = 1.96
"""Standard deviations by which the residuals must ask for offsets of the target from the sheet:
with two kinds of offset, one rig in twenty without any is taken to have some."""

_SHOWN_ODDS = 0.025
"""Odds of the in-plane views' larger scatter by chance at which they show offsets."""


def disturbing(adjustment: Adjustment) -> np.ndarray:
    """Mask ``(7,)`` of the components that disturb the observations of an adjustment."""
    boards = adjustment.boards
    there = {
        PIXEL: len(adjustment.stages) > 0,
        PLACEMENT: "plane" in adjustment.stages,
        MARKER: "plane" in adjustment.stages,
        CORNER: boards is not None,
        STRIPE: boards is not None and boards.lines is not None,
        LINE: boards is not None and boards.lines is not None,
        SHAPE: boards is not None and boards.lines is not None,
    }
    return np.array([there[k] for k in range(len(COMPONENTS))])


def with_one_size(fit: Fit, component: int) -> Fit:
    """The only unknown size is that of one noise: no weight changes with it."""
    freedom = fit.degrees_of_freedom
    variance = fit.noise.variances[component] * fit.chi2 / freedom
    variances = fit.noise.variances.copy()
    variances[component] = variance
    spread = NO_SPREAD.copy()
    spread[component, component] = 2.0 * variance**2 / freedom
    sized = replace(fit, noise=fit.noise.with_variances(variances), size_covariance=spread)
    if "contrasts" in vars(fit):  # they do not depend on the sizes, and cost an evaluation
        vars(sized)["contrasts"] = fit.contrasts
    return sized


def with_sizes(fit: Fit, free: np.ndarray, stage: str) -> Fit:
    """Residuals tell the noise, the noise weighs the residuals, until both agree."""
    rig, noise, adjustment, solution = fit.rig, fit.noise, fit.adjustment, fit.solution
    first = _first_sizes(fit, free)
    curved = fit.state.bends is not None
    if free[list(_OFFSETS)].any():
        # a curved sheet is seldom of second order only: what is left winds all lines
        free = free & (_asked_for(fit, first, free) | (curved & _IS_SHAPE))
        if not noise.placed_off and free.sum() == 1 and adjustment.boards is None:
            return with_one_size(fit, int(np.argmax(free)))
        if not free.any():
            return fit
    start = _first_offsets(fit, first.sizes, free)
    if free[SHAPE] and not curved:
        straight, wound = _of_winding_lines(fit, start, free)
        settled_fit = with_sizes(straight, free & ~_IS_SHAPE, stage)
        return replace(settled_fit, size_covariance=settled_fit.size_covariance + wound)
    variances, spread = noise.variances, NO_SPREAD
    acting, groups = disturbing(adjustment), fit.contrasts
    for _ in range(_NOISE_ROUNDS):
        try:
            found = _sizes(groups, adjustment, start, free)
        except np.linalg.LinAlgError:  # undetermined, which is for others to tell
            break
        spread = found.covariance
        alike = _alike(found.sizes[acting], variances[acting])
        variances = start = found.sizes
        if alike and solution.found:
            final = Fit(rig, adjustment, solution, noise.with_variances(variances), spread)
            vars(final)["contrasts"] = groups  # at this state: they need not be made again
            return final
        adjustment = weighed(fit, variances, solution.state)
        solution = settled(adjustment, solution.state, stage)
        groups = noise.contrasts(adjustment, solution.state, {})
    return Fit(rig, adjustment, solution, noise.with_variances(variances), spread)


def weighed(fit: Fit, variances: Array, state: RigState) -> Adjustment:
    """The adjustment of a fit with other variances, its lines reduced anew at a state."""
    old = fit.adjustment
    return fit.noise.with_variances(variances).adjustment(
        fit.rig, old.stages, old.parameters, state
    )


def _sizes(
    groups: Sequence[Contrasts], adjustment: Adjustment, start: Array, free: np.ndarray
) -> VarianceComponents:
    return variance_components(groups, adjustment.shared_size, start, free, _WELL_KNOWN)


def _alike(sizes: Array, others: Array) -> bool:
    """Whether variances give the same weights, a common factor apart."""
    there = (sizes > 0) | (others > 0)
    if not (sizes[there] > 0).all() or not (others[there] > 0).all():
        return False
    return bool(np.ptp(0.5 * np.log(sizes[there] / others[there])) <= _SETTLED)


def _of_winding_lines(fit: Fit, start: Array, free: np.ndarray) -> tuple[Fit, Array]:
    """The fit in which lines say no more than where they are and which way they run; and how well
    it is known how much they wind."""
    wound = NO_SPREAD.copy()
    with suppress(np.linalg.LinAlgError):
        found = _sizes(fit.contrasts, fit.adjustment, start, free)
        start, wound[SHAPE, SHAPE] = found.sizes, found.covariance[SHAPE, SHAPE]
    start = np.where(_IS_SHAPE, np.maximum(start, np.finfo(float).tiny), start)
    noise = replace(fit.noise.with_variances(start), free=fit.noise.free & ~_IS_SHAPE)
    stages, parameters = fit.adjustment.stages, fit.adjustment.parameters
    adjustment = noise.adjustment(fit.rig, stages, parameters, fit.state)
    solution = settled(adjustment, fit.state, "board")
    return Fit(fit.rig, adjustment, solution, noise, NO_SPREAD), wound


def _first_sizes(fit: Fit, free: np.ndarray) -> VarianceComponents:
    """Variances without offsets, roughly: what scales all residuals where that is the pixel noise
    alone, else estimated."""
    variances = np.where(free & _IS_OFFSET, 0.0, fit.noise.variances)
    always = free & ~_IS_OFFSET
    if fit.adjustment.boards is None:
        if free[PIXEL]:
            variances[PIXEL] *= max(fit.chi2 / fit.degrees_of_freedom, 1e-12)
        always = np.zeros_like(free)
    try:
        return _sizes(fit.contrasts, fit.adjustment, variances, always)
    except np.linalg.LinAlgError:
        nothing = np.zeros(len(variances))
        return VarianceComponents(variances, NO_SPREAD, False, nothing, NO_SPREAD)


def _asked_for(fit: Fit, first: VarianceComponents, free: np.ndarray) -> np.ndarray:
    """Components to estimate: each kind of offset from the sheet only where the residuals show it,
    the second beside the first.

    A variance that can only be positive would else, where there is none, be found too large.
    """
    variances, asked = first.sizes, free & ~_IS_OFFSET
    try:
        strength = np.where(free & ~asked, excess(first, free), -np.inf)
        best = int(np.argmax(strength))
        if strength[best] <= _SHOWN and not _scatters_more(
            fit.adjustment, fit.contrasts, variances, free
        ):
            return asked
        asked[best] = True
        start = _first_offsets(fit, variances, free & asked)
        found = _sizes(fit.contrasts, fit.adjustment, start, free & asked)
        return asked | (excess(found, free & asked) > _SHOWN)
    except np.linalg.LinAlgError:
        return asked


def _scatters_more(
    adjustment: Adjustment, groups: Sequence[Contrasts], variances: Array, free: np.ndarray
) -> bool:
    """Whether the in-plane views scatter more than the others, whichever way their markers move
    most: the score weighs those of large image motion, of which there may be few."""
    if not free[PLACEMENT]:
        return False
    squares, counts = {}, {}
    for stage, group in zip(adjustment.stages, groups, strict=False):  # the boards come last
        inverse = np.linalg.inv(group.covariance(variances * (np.arange(len(free)) == PIXEL)))
        squares[stage] = float(np.einsum("ni,nij,nj->", group.values, inverse, group.values))
        seen = int(adjustment.stages[stage].seen.sum())
        counts[stage] = 2 * seen - LOCAL_SIZE[stage] * len(group.values)
    own = sum(name.startswith("sheet") for name in adjustment.parameters)
    lying = counts["plane"] - own
    rest = sum(counts.values()) - adjustment.shared_size + own - counts["plane"]
    if lying < 1:
        return False
    if not free[PIXEL]:
        return float(chdtrc(lying, squares["plane"])) < _SHOWN_ODDS
    if rest < 1:
        return False
    others = max(sum(squares.values()) - squares["plane"], 1e-300)
    return float(fdtrc(lying, rest, squares["plane"] / lying / (others / rest))) < _SHOWN_ODDS


def _first_offsets(fit: Fit, variances: Array, free: np.ndarray) -> Array:
    """Variances at which offsets and the noise of single points are alike, as a start."""
    start = variances.copy()
    if free[PLACEMENT] or free[MARKER]:
        for component, part in fit.noise.parts(fit.adjustment, fit.state, "plane"):
            if component != PIXEL and free[component]:
                per_mm = float(np.trace(part, axis1=1, axis2=2).mean()) / part.shape[-1]
                start[component] = variances[PIXEL] / max(per_mm, 1e-12)
    for component in (LINE, SHAPE):
        if free[component]:
            parts = dict(fit.contrasts[-1].variances)
            stripe, own = (float(np.einsum("nii->", parts[k])) for k in (STRIPE, component))
            start[component] = variances[STRIPE] * stripe / max(own, 1e-300)
    return start
