"""A calibration checked by Monte Carlo, its trials spread over the cores."""

from __future__ import annotations

from dataclasses import replace

from sheetoflight.calibration.methods import CalibrationOptions
from sheetoflight.measurement.monte_carlo import (
    MonteCarloOptions,
    experiment,
    summarised,
    trial,
)
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.spread import ALONE, Execution, spread


def propagate(
    rig: Rig,
    calibration: Calibration,
    monte_carlo: MonteCarloOptions | None = None,
    options: CalibrationOptions | None = None,
    run: Execution = ALONE,
) -> Calibration:
    """The calibration with a Monte Carlo check of its uncertainties.

    What differs from the stated uncertainties is among the warnings. The result does not depend
    on the number of processes.

    Parameters
    ----------
    rig : Rig
        From which it was calibrated.
    calibration : Calibration
    monte_carlo : MonteCarloOptions, optional
    options : CalibrationOptions, optional
        Those it was calibrated with.
    run : Execution

    Raises
    ------
    InputError
        If the calibration was not made from this rig, or there is nothing to propagate.
    UntrustworthyError
        If nearly all trials are refused.
    """
    monte_carlo = monte_carlo or MonteCarloOptions()
    plan = experiment(rig, calibration, options or CalibrationOptions(), monte_carlo.seed)
    tasks = [(plan, number) for number in range(monte_carlo.trials)]
    trials = list(spread(trial, tasks, "monte carlo", run))
    found = summarised(plan, calibration, trials)
    warnings = (*calibration.warnings, *found.differences)
    return replace(calibration, monte_carlo=found, warnings=warnings)
