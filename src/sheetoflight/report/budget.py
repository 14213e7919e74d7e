"""What an uncertainty is made of, source by source, as numbers and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sheetoflight.measurement.length import Length, coverage_factor
from sheetoflight.model.covariance import Covariance
from sheetoflight.report.numbers import NO_UNCERTAINTY, decimals, parameter_unit

SOURCES = {
    "camera": "noise of the image points in stage camera",
    "sheet": "noise of the image points in stage plane",
    "crossing": "noise of the image points in stage crossing",
    "board": "noise of the boards' image points",
    "matches": "noise of the matched image points",
    "known camera": "the uncertainty of the camera that was held",
    "line": "points of the laser's line on the boards about the line itself",
    "lines off the sheet": "whole lines on the boards beside the sheet of light, and winding lines",
    "placement": "the target lying beside the sheet of light in stage plane",
    "target length": "the stated tolerance of the target's markers",
    "board length": "the stated uncertainty of the board's size",
    "board print": "points of the board off their places: as stated, or as the residuals show",
    "temperature": "the stated uncertainties of the target's temperature and expansion",
    "image points": "noise of the length's own image points",
    "calibration": "the whole calibration; the file does not say what that comes from",
}
"""Every source by its name in files, in the order of tables, and what it is."""

_MOST_FREEDOM = 9999.5
_SMALL_FREEDOM = 9.95
_LEAST_PART = 0.005


@dataclass(frozen=True)
class Budget:
    """A standard uncertainty and what it is made of.

    Parameters
    ----------
    name : str
        The quantity.
    std : float
        In `unit`.
    shares : tuple of (str, float)
        Standard uncertainties by source, adding in squares to `std`.
    degrees_of_freedom : float
        Effective ones; infinite where the noise was stated.
    unit : str
    """

    name: str
    std: float
    shares: tuple[tuple[str, float], ...]
    degrees_of_freedom: float = math.inf
    unit: str = "mm"

    def part(self, source: str) -> float:
        """What a source contributes to the variance, from 0 to 1; NaN where there is none."""
        return (dict(self.shares)[source] / self.std) ** 2 if self.std > 0 else math.nan


def length_budget(name: str, length: Length) -> Budget:
    """The budget of a measured length."""
    return Budget(name, length.std, length.budget, length.degrees_of_freedom)


def parameter_budgets(covariance: Covariance) -> tuple[Budget, ...]:
    """The budgets of all parameters of a covariance that were estimated, in its order."""
    return tuple(
        _parameter_budget(covariance, place, name)
        for place, name in enumerate(covariance.parameters)
    )


def _parameter_budget(covariance: Covariance, place: int, name: str) -> Budget:
    by_source: dict[str, float] = {}
    by_component: dict[str, float] = {}
    for source in covariance.parts():
        part = max(float(source.matrix[place, place]), 0.0)
        by_source[source.name] = by_source.get(source.name, 0.0) + part
        if source.component:
            by_component[source.component] = by_component.get(source.component, 0.0) + part
    variance = sum(by_source.values())
    return Budget(
        name,
        math.sqrt(variance),
        tuple((source, math.sqrt(part)) for source, part in by_source.items()),
        covariance.components.degrees_of_freedom(variance, by_component),
        parameter_unit(name),
    )


def sources_of(budgets: Iterable[Budget]) -> tuple[str, ...]:
    """The sources that occur, in the order of `SOURCES`; others after them."""
    found = dict.fromkeys(name for budget in budgets for name, _ in budget.shares)
    return (*(n for n in SOURCES if n in found), *(n for n in found if n not in SOURCES))


@dataclass(frozen=True)
class Share:
    """One source's part as text: in the quantity's unit, in per cent of the variance, and as a
    shade from 0 to 1."""

    std: str
    percent: str = ""
    shade: float = 0.0


@dataclass(frozen=True)
class BudgetRow:
    """One quantity as text: what it is, its uncertainty, effective degrees of freedom, coverage
    factor, and a share for each source of the table."""

    name: str
    unit: str
    std: str
    freedom: str
    coverage: str
    shares: tuple[Share, ...]


@dataclass(frozen=True)
class BudgetTable:
    """Budgets side by side: the sources, what they are, and the rows."""

    sources: tuple[str, ...]
    meanings: tuple[tuple[str, str], ...]
    rows: tuple[BudgetRow, ...]


def budget_table(budgets: Sequence[Budget], known: bool = True) -> BudgetTable:
    """Budgets as text.

    Parameters
    ----------
    budgets : sequence of Budget
    known : bool
        Whether the calibration carries a covariance; its part is said to be missing otherwise.
    """
    sources = sources_of(budgets)
    return BudgetTable(
        sources,
        tuple((name, SOURCES[name]) for name in sources if name in SOURCES),
        tuple(_row(budget, sources, known) for budget in budgets),
    )


def _row(budget: Budget, sources: tuple[str, ...], known: bool) -> BudgetRow:
    return BudgetRow(
        budget.name,
        budget.unit,
        f"{budget.std:.{decimals(budget.std)}f}",
        freedom_text(budget.degrees_of_freedom),
        f"{coverage_factor(budget.degrees_of_freedom):.2f}",
        tuple(_share(budget, source, known) for source in sources),
    )


def _share(budget: Budget, source: str, known: bool) -> Share:
    """A share ends one digit behind the whole, so that small ones are seen and all add up."""
    if source == "calibration" and not known:
        return Share(NO_UNCERTAINTY)
    if source not in dict(budget.shares):
        return Share("–")
    part = budget.part(source)
    text = f"{dict(budget.shares)[source]:.{decimals(budget.std) + 1}f}"
    if math.isnan(part):
        return Share(text)
    percent = "< 1 %" if 0 < part < _LEAST_PART else f"{100.0 * part:.0f} %"
    return Share(text, percent, round(min(part, 1.0), 3))


def freedom_text(degrees_of_freedom: float) -> str:
    """Degrees of freedom to what matters of them; very many are as good as infinitely many."""
    if degrees_of_freedom > _MOST_FREEDOM:
        return "∞"
    return f"{degrees_of_freedom:.{0 if degrees_of_freedom >= _SMALL_FREEDOM else 1}f}"
