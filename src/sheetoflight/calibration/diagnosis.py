"""Which fault the residuals point to.

Every fault is a way in which the points, or their images, would move (`faults`). Without
estimating them, score tests tell which hypothesis of each kind is worth most (`score_tests`); that
one is then estimated together with the sizes of the noise, and told if chance could not bring it
about.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.components import MARKER, PIXEL, PLACEMENT
from sheetoflight.calibration.faults import Hypothesis, hypotheses
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.line_scatter import (
    Scatter,
    bent_anyhow,
    line_scatter,
    noisy_stages,
    together,
)
from sheetoflight.calibration.residual_tests import exact
from sheetoflight.calibration.score_tests import ScoredFit
from sheetoflight.estimation.block_least_squares import scaled_inverse
from sheetoflight.estimation.variance_components import reduced_model, variance_components
from sheetoflight.model.diagnosis import Finding

_SIGNIFICANT = 1e-4
"""Odds of chance, all trials counted, below which a fault is told."""

LENS_ODDS = 1e-3
"""Odds below which bent images of straight targets look like an unmodelled lens."""

_ODD_TAIL = 0.025
"""Odds below which residuals look as if a diagnosis were worth while; one rig in twenty."""


def findings(fit: Fit) -> tuple[Finding, ...]:
    """What the residuals of a fit point to, the most likely first; empty where to nothing.

    Parameters
    ----------
    fit : Fit
        Of all stages together.
    """
    plain = without_placement(fit)
    try:
        tested = ScoredFit.of(plain)
    except np.linalg.LinAlgError:
        return ()
    if sum(tested.freedom.values()) < 3:
        return ()
    best: dict[str, tuple[float, Hypothesis]] = {}
    for hypothesis in hypotheses(plain, tested):
        gain = tested.gain(hypothesis.columns)
        if gain > best.get(hypothesis.cause, (0.0, hypothesis))[0]:
            best[hypothesis.cause] = (gain, hypothesis)
    found = [confirmed(fit, tested, hypothesis) for _, hypothesis in best.values()]
    told = sorted((f for f in found if f is not None), key=lambda finding: -finding.explained)
    return (*told, *bent_anyhow(fit, plain, tested), *noisy_stages(line_scatter(fit)))


def without_placement(fit: Fit) -> Fit:
    """The fit with the targets taken to lie in their sheets: what hides behind placement noise
    shows again."""
    if not fit.noise.placed_off:
        return fit
    variances, free = fit.noise.variances.copy(), fit.noise.free.copy()
    offsets = [PLACEMENT, MARKER]
    variances[offsets], free[offsets] = 0.0, False
    noise = replace(fit.noise, variances=variances, free=free)
    stages, parameters = fit.adjustment.stages, fit.adjustment.parameters
    return fitted(fit.rig, stages, parameters, fit.state, noise, "joint")


def confirmed(fit: Fit, tested: ScoredFit, hypothesis: Hypothesis) -> Finding | None:
    """A hypothesis as a finding, if it holds with the noise estimated anew beside it.

    Placement noise would pass for a fault, and a fault for placement noise, were the noise's
    sizes taken from a fit without the other; so both are estimated together (Wald's test).
    """
    size = fit.adjustment.shared_size
    count = next(iter(hypothesis.columns.values())).shape[-1]
    groups = [
        group.widened(hypothesis.columns.get(stage, None), size, count)
        for stage, group in zip(fit.adjustment.block_names, tested.widest(fit), strict=True)
    ]
    try:
        # a stated size may be wrong just where a fault is sought
        free = fit.noise.free | (np.arange(len(fit.noise.free)) == PIXEL)
        start = np.where(free, np.maximum(tested.sizes, 1e-12), fit.noise.variances)
        sizes = variance_components(groups, size + count, start, free).sizes
        model = reduced_model(groups, size + count, sizes)
        covariance = scaled_inverse(model.information)[0]
    except np.linalg.LinAlgError:
        return None
    estimate = -covariance @ model.gradient
    amount, own = estimate[size:], covariance[size:, size:]
    spread = own + np.diag(np.full(count, hypothesis.tolerance**2))
    placed_off = bool(sizes[[PLACEMENT, MARKER]].any() or fit.noise.placed_off)
    rest = _freedom(tested, hypothesis, count, placed_off)
    if rest < 1:
        return None
    ratio = float(amount @ np.linalg.solve(spread, amount)) / count
    odds = hypothesis.trials * float(fdtrc(count, rest, ratio))
    if not odds <= _SIGNIFICANT:
        return None
    text = hypothesis.text.format(
        size=float(amount[0]),
        std=float(np.sqrt(spread[0, 0])),
        norm=float(np.linalg.norm(amount)),
    )
    alone = np.linalg.inv(model.information[:size, :size])
    pulled = model.information[:size, size:] @ amount
    return Finding(
        hypothesis.stage,
        hypothesis.cause,
        text,
        hypothesis.remedy,
        explained=tested.explained(groups, estimate),
        odds=min(odds, 1.0),
        shift=float(np.sqrt(max(pulled @ alone @ pulled, 0.0))),
    )


def _freedom(tested: ScoredFit, hypothesis: Hypothesis, count: int, placed_off: bool) -> float:
    """Degrees of freedom of the scatter that the hypothesis is judged by."""
    if placed_off and tuple(hypothesis.columns) == ("plane",):
        # offsets from the sheet explain the residuals too, and a target's ends lie off it
        # together: each view is one independent witness
        views = len(tested.groups[tested.stages.index("plane")].values)
        return float(views - count)
    return sum(tested.freedom[stage] for stage in hypothesis.columns) - count


def suspicious(fit: Fit, scatter: Mapping[str, Scatter] | None = None) -> bool:
    """Whether a diagnosis is worth its time: the residuals differ from the markers' scatter about
    their lines, which needs no calibration, or targets seem to lie off their sheet."""
    if exact(fit):
        return False
    if fit.noise.free[PLACEMENT] and fit.noise.placed_off:
        return True
    scatter = scatter or line_scatter(fit)
    if noisy_stages(scatter):
        return True
    across = together(scatter)
    if across.lens_odds < LENS_ODDS and "camera.k1" not in fit.adjustment.parameters:
        return True
    squares, count = across.squares, across.freedom
    rest = fit.degrees_of_freedom - count
    if count < 3 or rest < 3:
        return True
    scale = fit.noise.variances[PIXEL] if fit.noise.free[PIXEL] else None
    chi2 = fit.degrees_of_freedom if scale is not None else fit.chi2
    ratio = ((chi2 - squares) / rest) / (squares / count) if squares > 0 else np.inf
    return not _ODD_TAIL < float(fdtrc(rest, count, max(ratio, 0.0))) < 1.0 - _ODD_TAIL
