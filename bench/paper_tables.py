"""The paper's Tables 2 and 4 as an experiment on points with noise.

Its rig, 30 camera views and 10 positions in the sheet with 0.1 px, then segments of its lengths
between 900 and 1300 mm whose ends are seen with some noise. Mean absolute error in mm by method,
beside what the true camera and sheet would give, which nothing can beat. Run with
``python -m bench.paper_tables [TRIALS]``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

import sheetoflight as sol
from sheetoflight.calibration.methods import METHODS
from sheetoflight.measurement.length import lengths
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.poses import observed_rig, segments_in_sheet
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.workflow.demonstration import PAPER_TABLES

SEED = 77
MARKER_NOISE_PX = 0.1
END_NOISE_PX = (0.03, 0.06, 0.1, 0.29)


def perfect(truth: SimulatedRig) -> Calibration:
    """The true camera and sheet."""
    return Calibration(
        method="truth",
        camera=truth.camera,
        light_planes=(truth.light_plane,),
        covariance=Covariance((), np.zeros((0, 0))),
        residuals=Residuals(0.0, 1.0),
        target=truth.target,
        pixel_std=MARKER_NOISE_PX,
    )


def table_errors(trials: int, table_mm: Sequence[float], end_noise_px: float) -> dict[str, float]:
    """Mean absolute error in mm by method, and with the truth, over a table's lengths."""
    truth = paper_rig()
    errors: dict[str, list[float]] = {}
    for trial in range(trials):
        rng = np.random.default_rng([SEED, trial])
        observations = observed_rig(truth, 30, 10, MARKER_NOISE_PX, rng)
        rig = Rig(truth.target, truth.camera.image_size, observations=observations)
        ends = np.concatenate([segments_in_sheet(truth, mm, 1, rng) for mm in table_mm])
        uv = truth.camera.project(ends)
        uv = np.clip(uv + rng.normal(scale=end_noise_px, size=uv.shape), 0, [1391, 1039])
        found = {method: sol.calibrate(rig, method=method) for method in METHODS}
        for name, calibration in {"truth": perfect(truth), **found}.items():
            measured = np.array([length.value for length in lengths(calibration, uv)])
            errors.setdefault(name, []).append(float(np.abs(measured - table_mm).mean()))
    return {name: float(np.mean(values)) for name, values in errors.items()}


def main(trials: int = 40) -> None:
    """Print the table."""
    table = Table(title=f"The paper's lengths, {trials} trials: mean |error| in mm")
    for heading in ("table", "printed", "ends seen to, px", "truth", *METHODS):
        table.add_column(heading, justify="left" if heading == "table" else "right")
    for name, table_mm, printed in PAPER_TABLES:
        for noise in END_NOISE_PX:
            errors = table_errors(trials, table_mm, noise)
            figures = (f"{errors[key]:.3f}" for key in ("truth", *METHODS))
            table.add_row(name, f"{np.mean(printed):.3f}", f"{noise:g}", *figures)
    Console(width=100).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
