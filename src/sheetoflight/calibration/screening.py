"""Before any method: what in the observations is wrong, and what that points to.

A first adjustment of everything shows whether the residuals are noise. If they are not, there
are two explanations: single detections or views are wrong, or a fault runs through all of them.
Both are tried, and the one that says more with fewer parameters is believed (Schwarz, Annals of
Statistics 6(2), 1978).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.diagnosis import LENS_ODDS, findings, suspicious
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.identifiability import roughly_determined
from sheetoflight.calibration.line_scatter import Scatter, line_scatter, noisy_stages, together
from sheetoflight.calibration.noise import NoiseModel, chi2_limit, noise_model
from sheetoflight.calibration.outliers import Cleaned, cleaned, looks_wrong
from sheetoflight.calibration.residual_tests import exact
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.search import best_fit
from sheetoflight.calibration.starts import with_sheets
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.diagnosis import Finding
from sheetoflight.model.rig import Rig

_BEYOND_DOUBT = 1e-5
"""Odds of chance below which a fault is reason enough to refuse; others are only told."""

_NOISIER = 4.0
"""Ratio of typical variances beyond which a stage is weighed by its own noise: it halves the
standard deviation's weight."""

_MISLEADING_SHIFT = 2.0
"""Standard uncertainties by which a fault may have moved the estimates: beyond, their intervals
miss."""

_MISLEADING_SHARE = 0.5
"""Share of the residuals beyond which they are the fault rather than noise."""

_NOISE_CAUSES = ("noisy stage",)


@dataclass(frozen=True)
class Screened:
    """A rig that can be calibrated.

    Parameters
    ----------
    rig : Rig
        Without what was found wrong.
    fit : Fit or None
        The joint fit of it; None where there is none.
    wrong : tuple of str
        What was left out, in words.
    findings : tuple of Finding
        What else the residuals point to.
    start : RigState, optional
        Camera and poses of the boards, where there are boards.
    noise : NoiseModel, optional
        What is known of its noise before it is adjusted, where that was worked out.
    """

    rig: Rig
    fit: Fit | None
    wrong: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    start: RigState | None = None
    noise: NoiseModel | None = None


def screened(rig: Rig, start: RigState | None = None) -> Screened:
    """Find what is wrong with the observations of a rig.

    Parameters
    ----------
    rig : Rig
    start : RigState, optional
        Camera and poses of its boards, which are screened already, where it has any.

    Raises
    ------
    UntrustworthyError
        If a fault runs through all views that would make the result misleading, or so much is
        wrong that what is right cannot be told.
    """
    if not rig.observations.stages():
        return _boards_only(rig, start)
    fit = _joint_fit(rig, start)
    if fit is None or not (fit.solution.converged and roughly_determined(fit)):
        return _screened_of_gross_errors(rig, start, fit)
    if exact(fit):
        return Screened(rig, fit)
    scatter = line_scatter(fit)
    factors = _noise_factors(scatter)
    if not factors:
        return _judged(rig, start, fit, scatter)
    noisy = noisy_stages(scatter)
    rig = _weighed(rig, fit.noise, factors)
    fit = _joint_fit(rig, start)
    found = _screened_of_gross_errors(rig, start, fit) if fit is None else _judged(rig, start, fit)
    others = (finding for finding in found.findings if finding.cause not in _NOISE_CAUSES)
    return replace(found, findings=(*others, *noisy))


def _boards_only(rig: Rig, start: RigState | None) -> Screened:
    task = _everything(rig, start)
    try:
        return Screened(rig, best_fit(task, with_sheets), noise=task.noise)
    except UntrustworthyError:
        return Screened(rig, None, noise=task.noise)


def _noise_factors(scatter: Mapping[str, Scatter]) -> dict[str, float]:
    """By how much the noise of stages exceeds that of the others, where it does so in most of
    their views."""
    factors = {}
    if together(scatter).lens_odds < LENS_ODDS:
        return factors
    for finding in noisy_stages(scatter):
        rest = together({s: part for s, part in scatter.items() if s != finding.stage})
        ratio = scatter[finding.stage].typical / max(rest.typical, 1e-300)
        if rest.freedom and ratio > _NOISIER:
            factors[finding.stage] = float(np.sqrt(ratio))
    return factors


def _weighed(rig: Rig, noise: NoiseModel, factors: Mapping[str, float]) -> Rig:
    """The rig with the noise of some stages so many times as large."""
    changed = {
        stage: replace(views, std=factors.get(stage, 1.0) * noise.proportions[stage])
        for stage, views in rig.observations.stages().items()
    }
    return replace(rig, observations=replace(rig.observations, **changed))


def _judged(
    rig: Rig, start: RigState | None, fit: Fit, scatter: Mapping[str, Scatter] | None = None
) -> Screened:
    wrong = looks_wrong(fit)
    if not wrong and not (_too_noisy(fit) or suspicious(fit, scatter)):
        return Screened(rig, fit)
    told = findings(fit)
    if not wrong:
        return _with_findings(Screened(rig, fit, (), told))
    try:
        left = cleaned(_everything(rig, start))
    except UntrustworthyError:
        refuse_misleading(told)
        raise
    clean_fit = _joint_fit(left.rig, start) if left.wrong else None
    if clean_fit is None or (told and _simpler(fit, told[0], clean_fit, left)):
        return _with_findings(Screened(rig, fit, (), told))
    return _without_what_is_wrong(left, clean_fit)


def _screened_of_gross_errors(rig: Rig, start: RigState | None, fit: Fit | None) -> Screened:
    """Where nothing fits: perhaps because of wrong detections. If not, the method will tell."""
    try:
        left = cleaned(_everything(rig, start))
    except (UntrustworthyError, np.linalg.LinAlgError):
        return _faulty_or_open(rig, fit)
    clean_fit = _joint_fit(left.rig, start) if left.wrong else None
    if clean_fit is None or not roughly_determined(clean_fit):
        return _faulty_or_open(rig, fit)
    return _without_what_is_wrong(left, clean_fit)


def _faulty_or_open(rig: Rig, fit: Fit | None) -> Screened:
    """A fault that large residuals show comes before what they leave open."""
    if fit is not None and fit.solution.converged and suspicious(fit):
        refuse_misleading(findings(fit))
    return Screened(rig, fit)


def _without_what_is_wrong(left: Cleaned, fit: Fit) -> Screened:
    words = tuple(entry.in_words for entry in left.wrong)
    rest = findings(fit) if fit.solution.converged and not exact(fit) else ()
    return _with_findings(Screened(left.rig, fit, words, rest))


def _with_findings(found: Screened) -> Screened:
    refuse_misleading(found.findings)
    return found


def _everything(rig: Rig, start: RigState | None) -> EstimationTask:
    return EstimationTask.of_everything(rig, noise_model(rig, start), start)


def _joint_fit(rig: Rig, start: RigState | None) -> Fit | None:
    try:
        return best_fit(_everything(rig, start), with_sheets)
    except UntrustworthyError:
        return None


def _too_noisy(fit: Fit) -> bool:
    """Whether the residuals exceed the stated noise."""
    freedom = fit.degrees_of_freedom
    return freedom > 0 and fit.chi2 > chi2_limit(freedom)


def _simpler(fit: Fit, finding: Finding, clean: Fit, left: Cleaned) -> bool:
    """Whether one fault explains the residuals better than leaving points out does."""
    if finding.cause in _NOISE_CAUSES:
        return False
    coordinates = 2 * sum(int(v.seen.sum()) for v in fit.adjustment.stages.values())
    parameters = 2 * sum(int(mask.sum()) for mask in left.masks.values())
    one = _squares(fit) * (1.0 - finding.explained)
    other = _squares(clean)
    return coordinates * np.log(one / other) < (parameters - 4) * np.log(coordinates)


def _squares(fit: Fit) -> float:
    """Sum of squared residuals, px²."""
    residuals = fit.adjustment.residuals_px(fit.state)
    return float(sum(np.nansum(part**2) for part in residuals.values())) + 1e-300


def refuse_misleading(told: tuple[Finding, ...]) -> None:
    """Refuse what a fault has made misleading.

    Raises
    ------
    UntrustworthyError
        If a finding that chance cannot explain has moved the estimates beyond their
        uncertainties, or is most of the residuals.
    """
    for finding in told:
        if finding.cause in _NOISE_CAUSES or finding.odds > _BEYOND_DOUBT:
            continue
        shifted = finding.shift > _MISLEADING_SHIFT
        if shifted or (finding.explained > _MISLEADING_SHARE and finding.shift > 0):
            raise UntrustworthyError(
                finding.stage,
                f"{finding.text}, which explains {finding.explained:.0%} of the residuals",
                finding.remedy,
            )
