"""How well a camera is known that calibrated itself, against the Cramér–Rao bound.

Simulated matches with 0.3 px of noise through a camera of 1400 × 1000 px; each set-up in many
trials with other points, turns and noise. For the focal length and the principal point: the root
mean square error; the same over the bound of each trial, which is 1 where the estimator is
efficient; and how often the stated 95 % interval holds. Then the same with wrong matches among
them. Run with ``python -m bench.self_calibration``; about a minute on one core.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.self_calibration import free_parameters
from sheetoflight.calibration.track_adjustment import TrackAdjustment, TrackState
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import reduced_equations
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

CAMERA = Camera((1400, 1000), 1500.0, 1480.0, 690.0, 510.0, distortion=(-0.1, 0, 0, 0, 0))
NOISE_PX = 0.3
TRIALS = 12
POINTS = 100
NORMAL_95 = 1.959964

Scene = Callable[[np.random.Generator], TrackState]


def turned(views: int, degrees: float) -> Scene:
    """Views from one point, turned by up to so much about all axes; points all around."""

    def made(rng: np.random.Generator) -> TrackState:
        turns = np.radians(degrees) * rng.uniform(-1.0, 1.0, (views, 3))
        turns[0] = 0.0
        rotations = rotation(turns)
        first = CAMERA.unproject(rng.uniform(0, 1, (POINTS, 2)) * np.array(CAMERA.image_size))
        view = rng.integers(0, views, POINTS)
        places = normalised(np.einsum("tji,tj->ti", rotations[view], first))
        return TrackState(CAMERA, rotations, np.zeros((views, 3)), places)

    return made


def carried(views: int, degrees: float) -> Scene:
    """Views from places about the first, that look at a scene one metre away; rolled as well."""

    def made(rng: np.random.Generator) -> TrackState:
        middle = np.array([0.0, 0.0, 1.0])
        turns = np.radians(degrees) * rng.uniform(-1.0, 1.0, (views, 3))
        turns[0] = 0.0
        rotations = rotation(turns)
        distance = rng.uniform(0.85, 1.15, (views, 1))
        distance[0] = 1.0
        translations = distance * middle - np.einsum("vij,j->vi", rotations, middle)
        points = rng.uniform([-0.3, -0.22, 0.75], [0.3, 0.22, 1.25], (POINTS, 3))
        unit = np.linalg.norm(translations[1])
        return TrackState(CAMERA, rotations, translations / unit, points / unit)

    return made


SETUPS: dict[str, tuple[str, Scene, float]] = {
    "3 views turned by 15°": ("rotating-camera", turned(3, 15.0), 0.0),
    "6 views turned by 15°": ("rotating-camera", turned(6, 15.0), 0.0),
    "6 views turned by 5°": ("rotating-camera", turned(6, 5.0), 0.0),
    "6 views turned by 15°, 5 % wrong": ("rotating-camera", turned(6, 15.0), 0.05),
    "4 views carried, 30°": ("moving-camera", carried(4, 30.0), 0.0),
    "8 views carried, 30°": ("moving-camera", carried(8, 30.0), 0.0),
    "8 views carried, 15°": ("moving-camera", carried(8, 15.0), 0.0),
    "8 views carried, 30°, 5 % wrong": ("moving-camera", carried(8, 30.0), 0.05),
}


@dataclass(frozen=True)
class Score:
    """What the trials of one set-up gave: errors over trials, for alpha and the principal point."""

    errors: Array
    bounds: Array
    stated: Array
    refused: int
    reduced: int
    wrong: int
    missed: int


def score(method: str, scene: Scene, share: float, trials: int = TRIALS) -> Score:
    """Calibrate one set-up again and again."""
    errors, bounds, stated = [], [], []
    refused = reduced = wrong = missed = 0
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        state = scene(rng)
        uv, bad = seen(state, share, rng)
        names = tuple(str(view) for view in range(len(uv)))
        observed = Observations(matches=PointMatches(names, uv))
        rig = Rig(CollinearTarget(), CAMERA.image_size, "radial1", observations=observed)
        try:
            found = calibrate(rig, method)
        except UntrustworthyError:
            refused += 1
            continue
        if "camera.beta" not in found.covariance.parameters or _is_reduced(found.warnings):
            reduced += 1
            continue
        used = np.stack([np.isfinite(view.residuals[:, 0]) for view in found.residuals.views])
        wrong, missed = wrong + int(bad.sum()), missed + int((used & bad).sum())
        off = found.camera.parameters - CAMERA.parameters
        errors.append(off[[0, 3, 4]])
        stated.append([found.covariance.std(f"camera.{name}") for name in ("alpha", "u0", "v0")])
        bounds.append(bound(state, np.where(bad[..., None], np.nan, uv)))
    off, least, told = (np.array(part).reshape(-1, 3) for part in (errors, bounds, stated))
    return Score(off, least, told, refused, reduced, wrong, missed)


def _is_reduced(warnings: tuple[str, ...]) -> bool:
    return any("one focal length" in warning for warning in warnings)


def seen(state: TrackState, share: float, rng: np.random.Generator) -> tuple[Array, np.ndarray]:
    """Image points with noise, NaN outside the picture, and which of them are wrong."""
    points = np.einsum("vij,tj->vti", state.rotations, state.places)
    exact = CAMERA.project(points + state.translations[:, None])
    inside = np.asarray(((exact >= 0) & (exact <= np.array(CAMERA.image_size) - 1.0)).all(axis=-1))
    uv = exact + NOISE_PX * rng.normal(size=exact.shape)
    bad = inside & (rng.random(inside.shape) < share)
    uv[bad] = rng.uniform(0, 1, (int(bad.sum()), 2)) * np.array(CAMERA.image_size)
    uv[~inside] = np.nan
    return uv, bad


def bound(state: TrackState, uv: Array) -> Array:
    """Least standard deviations of alpha, u0 and v0 of any unbiased estimate from these points."""
    often = np.isfinite(uv[..., 0]).sum(axis=0) >= 2
    tie = free_parameters("rectangular", "radial1")
    problem = TrackAdjustment(uv[:, often], tie, state.turns_only)
    part = TrackState(state.camera, state.rotations, state.translations, state.places[often])
    information = reduced_equations(problem.blocks(part), problem.shared_size)[0]
    return NOISE_PX * np.sqrt(np.diag(np.linalg.inv(information))[[0, 2, 3]])


def main() -> None:
    """Print the table."""
    table = Table(title=f"{TRIALS} trials each, {POINTS} points, {NOISE_PX} px")
    table.add_column("set-up", no_wrap=True)
    for heading in ("alpha, px", "u0, v0, px", "over bound", "in 95 %", "reduced", "refused",
                    "wrong missed"):  # fmt: skip
        table.add_column(heading, justify="right")
    for name, setup in SETUPS.items():
        found = score(*setup)
        rms = np.sqrt(np.mean(found.errors**2, axis=0))
        ratio = float(np.sqrt(np.mean((found.errors / found.bounds) ** 2)))
        held = float(np.mean(np.abs(found.errors) < NORMAL_95 * found.stated))
        table.add_row(name, f"{rms[0]:.2f}", f"{rms[1]:.2f}, {rms[2]:.2f}", f"{ratio:.2f}",
                      f"{held:.0%}", str(found.reduced), str(found.refused),
                      f"{found.missed} of {found.wrong}" if found.wrong else "–")  # fmt: skip
    Console(width=120).print(table)


if __name__ == "__main__":
    sys.exit(main())
