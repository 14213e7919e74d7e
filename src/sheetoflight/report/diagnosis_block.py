"""What the residuals point to, as rows of the page."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sheetoflight.model.calibration import Calibration
from sheetoflight.report.numbers import residuals_exceed_noise

LEFT_OUT = "left out as wrong"
"""How a warning begins that tells of a marker or view which took no part."""

_NOISE = (
    "The residuals are noise: no fault of target, lens, pivot or laser shows in them, and every "
    "marker took part."
)
_UNEXPLAINED = (
    "The residuals are larger than the stated noise, and no single fault of target, lens, pivot or "
    "laser explains that."
)
_BOARDS = (
    "No view, point or line was left out as wrong. No single fault is sought in boards: the "
    "residuals above show how they fit, and misprinted points are part of the uncertainty."
)
_NO_VIEWS = "This calibration carries no views, so nothing can be said of its residuals."
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class FindingRow:
    """One finding as text."""

    stage: str
    what: str
    explained: str
    odds: str
    remedy: str


@dataclass(frozen=True)
class Diagnosis:
    """The findings, what was left out, and a sentence where there is neither."""

    findings: tuple[FindingRow, ...]
    left_out: tuple[str, ...]
    sentence: str


def diagnosis(calibration: Calibration) -> Diagnosis:
    """What the residuals point to, and what took no part."""
    findings = tuple(
        FindingRow(
            one.stage,
            one.text,
            f"{100.0 * one.explained:.0f} %",
            _odds(one.odds),
            one.remedy,
        )
        for one in calibration.findings
    )
    left_out = tuple(
        warning.removeprefix(LEFT_OUT).lstrip(": ")
        for warning in calibration.warnings
        if warning.startswith(LEFT_OUT)
    )
    return Diagnosis(findings, left_out, "" if findings or left_out else _sentence(calibration))


def _sentence(calibration: Calibration) -> str:
    if not calibration.residuals.views:
        return _NO_VIEWS
    if {view.stage for view in calibration.residuals.views} == {"board"}:
        return _BOARDS
    return _UNEXPLAINED if residuals_exceed_noise(calibration) else _NOISE


def _odds(odds: float) -> str:
    """Of chance, to the order of magnitude: more is not known of odds so small."""
    if odds <= 0.0:
        return "below 10⁻³⁰⁰"
    exponent = f"{math.floor(math.log10(odds)):d}".translate(_RAISED)
    return f"10{exponent}"
