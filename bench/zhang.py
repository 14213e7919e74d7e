"""Zhang's simulation of camera calibration with a pivoting one-dimensional target.

His set-up (IEEE Trans. PAMI 26(7), 2004, section 4.1): alpha = beta = 1000, principal point
(320, 240), a target of 70 cm with its fixed point at (0, 35, 150) cm, 100 views with theta in
[pi/6, 5 pi/6] and phi in [pi, 2 pi], noise of 1 px, 120 trials. Prints the mean absolute errors in
per cent of alpha beside the Cramér–Rao bound, and the worst chi-squared per degree of freedom.
Run with ``python -m bench.zhang [TRIALS]``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.calibration.camera_alone import camera_alone
from sheetoflight.calibration.noise import noise_model
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed, target_points

NAMES = ("alpha", "beta", "gamma", "u0", "v0")
TRUTH = Camera((640, 480), 1000.0, 1000.0, 320.0, 240.0)
TARGET = CollinearTarget((0.0, 350.0, 700.0))
ANCHOR = np.array([0.0, 350.0, 1500.0])
NOISE_PX = 1.0
VIEWS = 100
TRIALS = 120


@dataclass(frozen=True)
class ZhangResult:
    """Errors and standard uncertainties ``(trials, 5)`` in px, chi-squared per degree of
    freedom ``(trials,)``."""

    errors: np.ndarray
    std: np.ndarray
    chi2_per_dof: np.ndarray

    @property
    def percent(self) -> np.ndarray:
        """Mean absolute errors ``(5,)`` in per cent of alpha."""
        return 100.0 * np.abs(self.errors).mean(axis=0) / TRUTH.alpha

    @property
    def bound_percent(self) -> np.ndarray:
        """Standard deviations ``(5,)`` of the Cramér–Rao bound, in per cent of alpha."""
        return 100.0 * np.sqrt((self.std**2).mean(axis=0)) / TRUTH.alpha


def zhang_rig(rng: np.random.Generator) -> Rig:
    """One trial's observations."""
    theta = rng.uniform(np.pi / 6, 5 * np.pi / 6, VIEWS)
    phi = rng.uniform(np.pi, 2 * np.pi, VIEWS)
    directions = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    origins = np.broadcast_to(ANCHOR, directions.shape)
    points = target_points(origins, directions, TARGET.positions)
    views = observed(TRUTH, points, NOISE_PX, rng)
    return Rig(
        TARGET,
        TRUTH.image_size,
        skew=True,
        pixel_std=NOISE_PX,
        observations=Observations(camera=views),
    )


def zhang_trials(trials: int = TRIALS) -> ZhangResult:
    """Calibrate the camera alone in every trial."""
    errors, std, chi2 = [], [], []
    for trial in range(trials):
        rig = zhang_rig(np.random.default_rng([1, trial]))
        fit, _ = camera_alone(rig, noise_model(rig))
        errors.append(fit.state.camera.parameters[:5] - TRUTH.parameters[:5])
        std.append(np.sqrt(np.diag(np.linalg.inv(fit.model().information))[:5]))
        chi2.append(fit.chi2 / fit.adjustment.degrees_of_freedom)
    return ZhangResult(np.array(errors), np.array(std), np.array(chi2))


def main(trials: int = TRIALS) -> None:
    """Print the table."""
    result = zhang_trials(trials)
    table = Table(title=f"Zhang's set-up, {NOISE_PX:g} px, {VIEWS} views, {trials} trials")
    table.add_column("parameter")
    table.add_column("mean |error|, % of alpha", justify="right")
    table.add_column("Cramér–Rao std, % of alpha", justify="right")
    for name, error, bound in zip(NAMES, result.percent, result.bound_percent, strict=True):
        table.add_row(name, f"{error:.3f}", f"{bound:.3f}")
    console = Console(width=100)
    console.print(table)
    console.print(f"largest chi-squared per degree of freedom: {result.chi2_per_dof.max():.3f}")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
