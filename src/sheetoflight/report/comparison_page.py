"""A comparison of methods as one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.metadata import version

from sheetoflight.measurement.contestants import PRINTED_MM
from sheetoflight.measurement.method_comparison import (
    LengthScore,
    MethodComparison,
    MethodScore,
)
from sheetoflight.report.comparison_figures import errors_by_length
from sheetoflight.report.environment import environment
from sheetoflight.report.numbers import two_digits
from sheetoflight.report.plots import Plot, plot

_NOTHING = "–"


def build_comparison_page(comparison: MethodComparison, times: bool = False) -> str:
    """Methods side by side as one HTML page: a figure, tables, what was compared.

    The page holds its figure and the code that draws it, and forbids the browser to load anything
    else. The same input gives the same text.

    Parameters
    ----------
    comparison : MethodComparison
    times : bool
        Whether to show how long calibrations took.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    options = comparison.options
    paper = options.case == "paper"
    return (
        environment()
        .get_template("comparison.html")
        .render(
            options=options,
            times=times,
            paper=paper,
            best=_best(comparison),
            lengths=[f"{length:g}" for length in options.lengths],
            methods=[_method(score) for score in comparison.scores],
            exact=[(one.name, _cells(comparison, one, _exact)) for one in comparison.scores],
            measured=[
                (one.name, _cells(comparison, one, _printed if paper else _measured))
                for one in comparison.scores
            ],
            refusals=[one for one in comparison.scores if one.refused],
            figure=_figure(comparison),
            provenance=_provenance(comparison),
        )
    )


def _figure(comparison: MethodComparison) -> Plot:
    return plot(
        errors_by_length(comparison),
        "figure-errors",
        "Error and bound",
        "Root mean square error that the calibration alone causes; a dash of the same colour is "
        "the least that any method could reach on the same pictures. Both axes are logarithmic; "
        "marks of one length stand side by side.",
        "tall",
    )


def _best(comparison: MethodComparison) -> tuple[str, str, str]:
    """The method that measures the longest length best: name, length and its error."""
    known = [score for score in comparison.scores if score.lengths]
    first = min(known, key=lambda score: score.lengths[-1].rms_mm)
    longest = first.lengths[-1]
    return first.name, f"{longest.length_mm:g}", two_digits(longest.rms_mm)


def _method(score: MethodScore) -> dict[str, str]:
    return {
        "name": score.name,
        "views": " + ".join(f"{count} {stage}" for stage, count in score.views.items()),
        "normal": _number(score.normal_deg, ".4f"),
        "plane": _number(score.plane_mm, ".3f"),
        "share": _share(score.bound_share, score.bound_share_std),
        "coverage": _number(100 * score.coverage, ".1f"),
        "measured_coverage": _number(100 * score.measured_coverage, ".1f"),
        "seconds": _number(score.seconds, ".2f"),
        "refused": str(score.refused),
    }


def _cells(
    comparison: MethodComparison,
    score: MethodScore,
    cell: Callable[[str, LengthScore], tuple[str, str]],
) -> list[tuple[str, str]]:
    """Figure and remark for each length; dashes where a method refused every trial."""
    if not score.lengths:
        return [(_NOTHING, "")] * len(comparison.options.lengths)
    return [cell(score.name, length) for length in score.lengths]


def _exact(_: str, length: LengthScore) -> tuple[str, str]:
    return two_digits(length.rms_mm), _share(length.bound_share, length.bound_share_std)


def _measured(_: str, length: LengthScore) -> tuple[str, str]:
    return two_digits(length.measured_rms_mm), f"mean {two_digits(length.measured_mean_mm)}"


def _printed(name: str, length: LengthScore) -> tuple[str, str]:
    printed = PRINTED_MM.get(name, {}).get(length.length_mm)
    remark = "" if printed is None else f"printed {printed:.3f}"
    return two_digits(length.measured_mean_mm), remark


def _share(share: float, std: float) -> str:
    spread = f" ± {100 * std:.0f}" if math.isfinite(std) else ""
    return f"{100 * share:.0f}{spread} %" if math.isfinite(share) else _NOTHING


def _number(value: float, form: str) -> str:
    return f"{value:{form}}" if math.isfinite(value) else _NOTHING


def _provenance(comparison: MethodComparison) -> list[tuple[str, str]]:
    options = comparison.options
    return [
        ("software", f"sheetoflight {version('sheetoflight')}"),
        ("case", options.case),
        ("pictures", f"{options.pictures} a method"),
        ("camera_share", f"{options.camera_share:g}"),
        ("pixel_std", f"{options.pixel_std:g} px"),
        ("line_std", f"{options.line_noise:g} px, {options.line_points} points on a line"),
        ("end_std", f"{options.end_noise:g} px"),
        ("segments", f"{options.segments} of each length"),
        ("distortion", ", ".join(f"{k:g}" for k in options.distortion)),
        ("trials", str(options.trials)),
        ("seed", str(options.seed)),
    ]
