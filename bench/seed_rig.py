"""The seed rig from points with noise: errors of lengths that the calibration alone causes.

Mean absolute error in mm of random 150 and 450 mm segments in the sheet, their image points
free of noise, by method; beside it what the calibrations' own covariances predict, which for
``joint`` is the Cramér–Rao bound, and the figures promised. Run with
``python -m bench.seed_rig [TRIALS]``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

import sheetoflight as sol
from sheetoflight.measurement.length import lengths
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.poses import observed_rig, segments_in_sheet
from sheetoflight.simulation.rig import paper_rig

LENGTHS_MM = (150.0, 450.0)
SEGMENTS = 60
SEED = 2024


@dataclass(frozen=True)
class Case:
    """Positions in the sheet, noise, lens; and the figures promised for the methods."""

    name: str
    positions: int
    pixel_std: float
    distortion: str
    promised: dict[str, tuple[float, float]]


CASES = (
    Case("10 positions, 0.1 px", 10, 0.1, "none",
         {"paper": (0.20, 0.62), "two-step": (0.041, 0.099), "joint": (0.029, 0.076)}),
    Case("10 positions, 0.3 px", 10, 0.3, "none",
         {"paper": (0.63, 1.81), "two-step": (0.10, 0.23), "joint": (0.071, 0.17)}),
    Case("30 positions, 0.1 px", 30, 0.1, "none",
         {"paper": (0.16, 0.51), "two-step": (0.031, 0.070), "joint": (0.013, 0.035)}),
    Case("10, 0.1 px, k1 = -0.1, k2 = 0.05", 10, 0.1, "radial2",
         {"two-step": (np.nan, 0.125), "joint": (np.nan, 0.072), "paper": (np.nan, 0.83)}),
)  # fmt: skip


def length_errors(case: Case, method: str, trials: int, seed: int = SEED) -> np.ndarray:
    """Errors ``(trials, 2, SEGMENTS)`` in mm for the two lengths."""
    return errors_and_predictions(case, method, trials, seed)[0]


def errors_and_predictions(
    case: Case, method: str, trials: int, seed: int = SEED
) -> tuple[np.ndarray, np.ndarray]:
    """Errors, and the standard uncertainties that the calibrations state for them, in mm."""
    k1, k2 = (-0.1, 0.05) if case.distortion != "none" else (0.0, 0.0)
    truth = paper_rig((k1, k2, 0.0, 0.0, 0.0))
    errors = np.empty((trials, len(LENGTHS_MM), SEGMENTS))
    stated = np.empty_like(errors)
    for trial in range(trials):
        rng = np.random.default_rng([seed, trial])
        observations = observed_rig(truth, 30, case.positions, case.pixel_std, rng)
        rig = Rig(truth.target, truth.camera.image_size, case.distortion, observations=observations)
        calibration = sol.calibrate(rig, method=method)
        for row, length_mm in enumerate(LENGTHS_MM):
            ends = segments_in_sheet(truth, length_mm, SEGMENTS, rng)
            measured = lengths(calibration, truth.camera.project(ends))
            errors[trial, row] = [found.value - length_mm for found in measured]
            stated[trial, row] = [found.calibration_std for found in measured]
    return errors, stated


def main(trials: int = 100) -> None:
    """Print the table."""
    table = Table(title=f"Seed rig, 30 camera views, {trials} trials: mean |error| in mm")
    for heading in ("case", "method"):
        table.add_column(heading)
    for length_mm in LENGTHS_MM:
        for heading in ("found", "predicted", "promised"):
            table.add_column(f"{length_mm:.0f} mm\n{heading}", justify="right")
    for case in CASES:
        for method, promised in case.promised.items():
            errors, stated = errors_and_predictions(case, method, trials)
            found = np.abs(errors).mean(axis=(0, 2))
            predicted = np.sqrt(2 / np.pi) * stated.mean(axis=(0, 2))
            figures = np.stack([found, predicted, promised], axis=1).ravel()
            table.add_row(case.name, method, *(f"{figure:.3f}" for figure in figures))
    Console(width=130).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
