"""The Monte Carlo check of a calibration as tables of the page."""

from __future__ import annotations

from collections.abc import Sequence

from sheetoflight.model.calibration import Calibration
from sheetoflight.model.monte_carlo import MonteCarlo, PropagatedLength, PropagatedQuantity
from sheetoflight.report.contents import Table
from sheetoflight.report.numbers import rounded, two_digits

_COLUMNS = (
    "Value",
    "Mean shift",
    "Standard deviation",
    "95 % interval",
    "Standard uncertainty stated",
    "95 % interval stated",
    "Ratio of standard uncertainties",
    "Ratio of intervals' widths",
    "Stated interval holds the truth",
)


def monte_carlo_tables(calibration: Calibration) -> tuple[Table, ...]:
    """One table of lengths across the field and one of parameters, each with its verdict.

    Rows that differ from what is stated are set off. None where no Monte Carlo was made.
    """
    found = calibration.monte_carlo
    if found is None:
        return ()
    tables = []
    if found.lengths:
        several = len({length.laser for length in found.lengths}) > 1
        names = [_name(length, several) for length in found.lengths]
        note = (
            f"{_note(found)} The lengths in mm lie between fixed image points, whose own noise "
            "is in neither column."
        )
        tables.append(_table("Lengths, by Monte Carlo and as stated", names, found.lengths, note))
    if found.parameters:
        names = [quantity.name for quantity in found.parameters]
        title = "Parameters, by Monte Carlo and as stated"
        tables.append(_table(title, names, found.parameters, _note(found)))
    return tuple(tables)


def _name(length: PropagatedLength, several: bool) -> str:
    return f"{length.laser}: {length.name}" if several else length.name


def _note(found: MonteCarlo) -> str:
    said = " ".join(f"{sentence[0].upper()}{sentence[1:]}." for sentence in found.verdict)
    return (
        f"The rig was simulated again from this result and calibrated again {found.trials} times, "
        f"{found.refused} of which were refused. {said}"
    )


def _table(
    title: str, names: Sequence[str], quantities: Sequence[PropagatedQuantity], note: str
) -> Table:
    differing = tuple(i for i, quantity in enumerate(quantities) if quantity.excess > 1.0)
    rows = tuple(
        (name, *_cells(quantity)) for name, quantity in zip(names, quantities, strict=True)
    )
    return Table(title, ("Quantity", *_COLUMNS), rows, note, differing)


def _cells(quantity: PropagatedQuantity) -> tuple[str, ...]:
    value, stated = rounded(quantity.value, quantity.analytic_std)
    shift, _ = rounded(quantity.mean_shift, quantity.analytic_std)
    return (
        value,
        shift,
        two_digits(quantity.std),
        _interval(quantity.low, quantity.high, quantity.analytic_std),
        stated,
        _interval(quantity.analytic_low, quantity.analytic_high, quantity.analytic_std),
        f"{quantity.std_ratio:.2f} ± {quantity.std_ratio_std:.2f}",
        f"{quantity.width_ratio:.2f} ± {quantity.width_ratio_std:.2f}",
        f"{quantity.coverage:.1%} ± {quantity.coverage_std:.1%}",
    )


def _interval(low: float, high: float, std: float) -> str:
    return f"{rounded(low, std)[0]} … {rounded(high, std)[0]}"
