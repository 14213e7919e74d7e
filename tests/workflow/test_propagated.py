"""Monte Carlo over several processes."""

from __future__ import annotations

from dataclasses import replace

from sheetoflight.calibration.methods import calibrate
from sheetoflight.io.calibration_json import calibration_text
from sheetoflight.measurement.monte_carlo import MonteCarloOptions
from sheetoflight.workflow.propagated import propagate
from sheetoflight.workflow.spread import Execution
from tests.calibration.examples import simulated


def test_the_number_of_processes_changes_no_byte() -> None:
    _, rig = simulated(views=(12, 6))
    calibration = calibrate(rig)
    told: list[tuple[str, int, int]] = []
    texts = []
    for processes in (1, 2):
        run = Execution(lambda *progress: told.append(progress), processes)
        texts.append(
            calibration_text(propagate(rig, calibration, MonteCarloOptions(100, 5), run=run))
        )
    assert texts[0] == texts[1]
    assert '"seed": 5' in texts[0]
    assert told[0] == ("monte carlo", 0, 100)
    assert told[-1] == ("monte carlo", 100, 100)


def test_what_differs_is_among_the_warnings() -> None:
    """Stated uncertainties of half their size: with 100 trials the ratio of 2 lies 14 of its
    standard deviations beyond 1."""
    _, rig = simulated(views=(12, 6), stated=True)
    calibration = calibrate(rig)
    half = replace(calibration.covariance, matrix=calibration.covariance.matrix / 4, sources=())
    found = propagate(rig, replace(calibration, covariance=half), MonteCarloOptions(100))
    assert found.monte_carlo is not None
    added = found.warnings[len(calibration.warnings) :]
    assert added == found.monte_carlo.differences != ()
