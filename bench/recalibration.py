"""How many calibrations a second one core does, and what one costs in evaluations.

The paper's rig, 30 + 10 views, with new noise each time; everything that ``sol.calibrate`` does:
start, search, screening, noise, covariance. Beside it the least time of one evaluation of the
adjustment – residuals and derivatives of all views, and residuals alone – which no calibration
can be cheaper than a few of: on another machine, or under load, the ratio stays. Processor time,
the best of several rounds. Run with ``OPENBLAS_NUM_THREADS=1 python -m bench.recalibration``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console

from bench.solver import simulated_rig, starting_state
from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.rig_state import ANCHOR, intrinsic_names, sheet_names

CALIBRATIONS = 40
ROUNDS = 7


@dataclass(frozen=True)
class Costs:
    """Seconds of processor time."""

    calibration: float
    evaluation: float
    residuals: float


def costs(calibrations: int = CALIBRATIONS, rounds: int = ROUNDS) -> Costs:
    """The least of several rounds, taken in turn."""
    rigs = [simulated_rig(30, 10, seed) for seed in range(calibrations)]
    start = starting_state(rigs[0])
    free = (*intrinsic_names(rigs[0].free_intrinsics), *ANCHOR, *sheet_names(1))
    stages = rigs[0].observations.stages()
    adjustment = noise_model(rigs[0]).adjustment(rigs[0], stages, free, start)
    steps: tuple[Callable[[], object], ...] = (
        lambda: [calibrate(rig) for rig in rigs],
        lambda: [adjustment.blocks(start) for _ in rigs],
        lambda: [adjustment.residuals_px(start) for _ in rigs],
    )
    taken = [[_seconds(step) / calibrations for step in steps] for _ in range(rounds)]
    return Costs(*(min(column) for column in zip(*taken, strict=True)))


def _seconds(step: Callable[[], object]) -> float:
    begin = time.process_time()
    step()
    return time.process_time() - begin


def main() -> None:
    """Print the figures."""
    found = costs()
    Console(width=100).print(
        f"30 + 10 views: {1.0 / found.calibration:.0f} calibrations a second, "
        f"{1e3 * found.calibration:.1f} ms each: {found.calibration / found.evaluation:.0f} "
        f"evaluations of residuals and derivatives ({1e6 * found.evaluation:.0f} µs), "
        f"{found.calibration / found.residuals:.0f} of residuals alone "
        f"({1e6 * found.residuals:.0f} µs)"
    )


if __name__ == "__main__":
    sys.exit(main())
