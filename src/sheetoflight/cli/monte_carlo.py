"""``sol calibrate --monte-carlo``: how the check is made and told."""

from __future__ import annotations

import sys
import time
from typing import Any

from rich.markup import escape

from sheetoflight.calibration.methods import CalibrationOptions
from sheetoflight.cli.telling import plain_table, tell, tell_table, warn
from sheetoflight.measurement.monte_carlo import MonteCarloOptions
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.monte_carlo import MonteCarlo, PropagatedQuantity
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.calibrated import calibrate
from sheetoflight.workflow.propagated import propagate
from sheetoflight.workflow.spread import Execution

_LONG_S = 60.0
_COLUMNS = ("stated u", "shift / u", "std / u", "width ratio", "holds truth")


def calibrate_and_check(
    rig: Rig,
    method: str,
    options: CalibrationOptions,
    monte_carlo: MonteCarloOptions,
    run: Execution,
) -> Calibration:
    """Calibrate, then check by Monte Carlo; tell how long that takes, and how long it took."""
    started = time.perf_counter()
    calibration = calibrate(rig, method, options)
    once = time.perf_counter() - started
    expected = once * monte_carlo.trials / run.processes
    if expected > _LONG_S:
        warn(
            f"{monte_carlo.trials} trials by method {method}, {once:.2g} s each, will take about "
            f"{_in_words(expected)} – fewer trials are quicker, and so is --method joint"
        )
    started = time.perf_counter()
    checked = propagate(rig, calibration, monte_carlo, options, run)
    taken = time.perf_counter() - started
    print(
        f"monte carlo: {monte_carlo.trials} trials in {taken:.1f} s, "
        f"{monte_carlo.trials / taken:.3g} a second",
        file=sys.stderr,
    )
    return checked


def _in_words(seconds: float) -> str:
    for unit, size in (("seconds", 1.0), ("minutes", 60.0)):
        if seconds < 100.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds / 3600.0:.0f} hours"


def monte_carlo_summary(monte_carlo: MonteCarlo) -> dict[str, Any]:
    """What a program asks for first; all else stands in the file."""
    return {
        "trials": monte_carlo.trials,
        "refused": monte_carlo.refused,
        "seed": monte_carlo.seed,
        "agrees": monte_carlo.agrees,
        "verdict": list(monte_carlo.verdict),
    }


def tell_monte_carlo(monte_carlo: MonteCarlo) -> None:
    """Print the comparison and what it means."""
    table = plain_table(
        f"Monte Carlo: {monte_carlo.trials} trials, {monte_carlo.refused} refused",
        ("quantity",),
        _COLUMNS,
    )
    several = len({length.laser for length in monte_carlo.lengths}) > 1
    for quantity in monte_carlo.parameters:
        table.add_row(quantity.name, *_cells(quantity))
    for length in monte_carlo.lengths:
        name = f"{length.laser}: {length.name}" if several else length.name
        table.add_row(escape(name), *_cells(length))
    tell_table(table)
    tell(f"by chance alone: {_chance(monte_carlo)}")
    for sentence in monte_carlo.verdict:
        tell(f"verdict: {sentence}")


def _cells(quantity: PropagatedQuantity) -> tuple[str, ...]:
    return (
        f"{quantity.analytic_std:.2g}",
        f"{quantity.relative_shift:+.2f}",
        f"{quantity.std_ratio:.2f}",
        f"{quantity.width_ratio:.2f}",
        f"{quantity.coverage:.1%}",
    )


def _chance(monte_carlo: MonteCarlo) -> str:
    """What the columns would scatter by from one Monte Carlo to the next."""
    widest = max(
        (*monte_carlo.parameters, *monte_carlo.lengths), key=lambda one: one.width_ratio_std
    )
    return (
        f"shift ± {widest.shift_std:.2f}, std ± {widest.std_ratio_std:.2f}, width ratio "
        f"± {widest.width_ratio_std:.2f}, holds truth ± {widest.coverage_std:.1%}"
    )
