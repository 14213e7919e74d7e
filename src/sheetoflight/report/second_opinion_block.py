"""Rod and board, each solved alone, as tables of the page."""

from __future__ import annotations

from sheetoflight.model.calibration import Calibration
from sheetoflight.model.second_opinion import Agreement, SecondOpinion
from sheetoflight.report.contents import Table
from sheetoflight.report.numbers import parameter_unit, rounded, two_digits

_FAR = 3.0
"""Differences beyond so many standard uncertainties are set off."""

_PARAMETERS = (
    "Parameter",
    "Rod alone",
    "Board alone",
    "Difference",
    "Standard uncertainty of the difference",
    "Difference in standard uncertainties",
    "Unit",
)

_SHEETS = (
    "Sheet",
    "Pixels",
    "Nearest, mm",
    "Farthest, mm",
    "Difference, rms, mm",
    "Largest, mm",
    "Rms to be expected, mm",
)


def second_opinion_tables(calibration: Calibration) -> tuple[Table, ...]:
    """What each determines with the verdict, the parameters, and points at the measuring
    distance. None where there is one kind of evidence only."""
    opinion = calibration.second_opinion
    if opinion is None:
        return ()
    tables = [_opinions(opinion)]
    if opinion.parameters:
        tables.append(_parameters(opinion))
    if opinion.sheets:
        tables.append(_sheets(opinion))
    return tuple(tables)


def _opinions(opinion: SecondOpinion) -> Table:
    rows = tuple(
        (one.kind, one.views, ", ".join(one.determines) or "nothing", one.refusal or "–")
        for one in (opinion.rod, opinion.board)
    )
    note = " ".join(f"{said[0].upper()}{said[1:]}." for said in opinion.verdict)
    columns = ("Evidence", "Views", "Determines alone", "Why not more")
    return Table("Second opinion: rod and board, each solved alone", columns, rows, note)


def _parameters(opinion: SecondOpinion) -> Table:
    far = tuple(i for i, one in enumerate(opinion.parameters) if abs(one.z) > _FAR)
    rows = tuple(_cells(one) for one in opinion.parameters)
    note = "The two share no picture, so that the variances of both add up."
    return Table("Parameters by rod and board", _PARAMETERS, rows, note, far)


def _cells(one: Agreement) -> tuple[str, ...]:
    difference, std = rounded(one.difference, one.std)
    return (
        one.name,
        rounded(one.first, one.std)[0],
        rounded(one.second, one.std)[0],
        difference,
        std,
        f"{one.z:+.1f}",
        parameter_unit(one.name),
    )


def _sheets(opinion: SecondOpinion) -> Table:
    rows = tuple(
        (
            sheet.laser,
            sheet.points,
            f"{sheet.nearest_mm:.0f}",
            f"{sheet.farthest_mm:.0f}",
            two_digits(sheet.rms_mm),
            two_digits(sheet.largest_mm),
            two_digits(sheet.std_mm),
        )
        for sheet in opinion.sheets
    )
    note = "Points of the same pixels by either, where the sheet was seen; camera frame."
    return Table("Points in the sheet by rod and board", _SHEETS, rows, note)
