"""A verification as one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

from sheetoflight.measurement.comparison import Comparison, MeasuredSegment
from sheetoflight.measurement.error_statistics import Estimate
from sheetoflight.measurement.verification import Verification
from sheetoflight.report import numbers, verification_figures
from sheetoflight.report.environment import environment
from sheetoflight.report.plots import Plot, plot

_NOT_GIVEN = "–"


def build_verification_page(verification: Verification) -> str:
    """Errors of known lengths as one HTML page: verdict, table, figures, what was compared.

    The page holds its figures and the code that draws them, and forbids the browser to load
    anything else. The same input gives the same text.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    return (
        environment()
        .get_template("verification.html")
        .render(
            verification=verification,
            statistics=verification.statistics,
            total=len(verification.comparisons),
            failed=len(verification.failed),
            quantities=_quantities(verification),
            rows=[_row(one) for one in verification.comparisons],
            not_judged=[_measured(segment) for segment in verification.not_judged],
            plots=_plots(verification),
            provenance=tuple(numbers.flat(verification.provenance)),
        )
    )


def _plots(verification: Verification) -> list[Plot]:
    plots = [
        plot(
            verification_figures.errors_over_length(verification),
            "figure-errors",
            "Errors over the length",
            "Measured minus known, with 95 % bars of both lengths' uncertainties.",
        ),
        plot(
            verification_figures.segments_in_picture(verification),
            "figure-segments",
            "Where the lengths were seen",
            "Lengths in all parts of the picture and all directions say more than the same one "
            "again.",
            "tall",
        ),
    ]
    if any(one.normalised_error is not None for one in verification.comparisons):
        normalised = plot(
            verification_figures.normalised_errors(verification),
            "figure-normalised",
            "Normalised errors",
            "Error over its expanded uncertainty. Where the stated uncertainties hold, 95 % lie "
            "in the band; all on one side speak of what they share, the calibration.",
        )
        plots.insert(1, normalised)
    return plots


def _quantities(verification: Verification) -> list[tuple[str, str, str, str]]:
    """Meaning, value, standard uncertainty and unit of each number of the summary."""
    statistics = verification.statistics
    spread = _NOT_GIVEN if statistics.spread is None else numbers.two_digits(statistics.spread)
    rows = [
        ("mean error", *_estimate(statistics.mean), "mm"),
        ("spread of the errors (sample standard deviation)", spread, "", "mm"),
        ("root mean square error", numbers.two_digits(statistics.rms), "", "mm"),
        ("largest absolute error", numbers.two_digits(statistics.largest), "", "mm"),
        ("scale: growth of the error with the length", *_estimate(statistics.scale), "mm/m"),
    ]
    if statistics.offset:
        rows.append(("constant error of all lengths", *_estimate(statistics.offset), "mm"))
    if statistics.chi2 is not None and statistics.chi2_p is not None:
        rows += [
            (f"χ² of the {statistics.number} errors", f"{statistics.chi2:.2f}", "", ""),
            ("odds of a larger χ² by chance", f"{statistics.chi2_p:.2g}", "", ""),
        ]
    return rows


def _estimate(estimate: Estimate) -> tuple[str, str]:
    value, std = numbers.rounded(estimate.value, estimate.std)
    return (value if value.startswith("-") else f"+{value}"), std


def _measured(segment: MeasuredSegment) -> tuple[str, str, str]:
    return (segment.name, *numbers.rounded(segment.length.value, segment.length.std))


def _row(one: Comparison) -> dict[str, object]:
    normalised = one.normalised_error
    return {
        "name": one.segment.name,
        "known": f"{one.known.value:.7g}",
        "known_std": numbers.two_digits(one.known.std) if one.known.std else "exact",
        "measured": f"{one.segment.length.value:.4f}",
        "error": f"{one.error:+.4f}",
        "expanded": f"{one.expanded:.4f}",
        "normalised": _NOT_GIVEN if normalised is None else f"{normalised:+.2f}",
        "limit": _NOT_GIVEN if one.limit is None else f"{one.limit:.4g}",
        "decision": one.decision or _NOT_GIVEN,
        "passed": one.passed,
    }
