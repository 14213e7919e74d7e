"""The joint adjustment beside ``scipy.optimize.least_squares`` on the same residuals.

The reference knows nothing of this package's solver: another parametrisation (angles instead of
tangent steps), its own projection, SciPy's trust region. Prints the
greatest relative difference of a parameter, the ratio of the times in turn, and how the time of
the joint adjustment grows with the number of views. Run with ``python -m bench.solver``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import OptimizeResult, least_squares

from sheetoflight.calibration.camera_alone import camera_alone
from sheetoflight.calibration.fitting import fitted, settled
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.rig_state import ANCHOR, RigState, intrinsic_names, sheet_names
from sheetoflight.calibration.starts import evidence, with_sheets
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig

SEED = 11


def simulated_rig(camera_views: int, plane_views: int, seed: int = SEED) -> Rig:
    """The paper's rig with 0.1 px noise."""
    truth = paper_rig()
    rng = np.random.default_rng(seed)
    observations = observed_rig(truth, camera_views, plane_views, 0.1, rng)
    return Rig(truth.target, truth.camera.image_size, observations=observations)


def starting_state(rig: Rig) -> RigState:
    """Where both solvers begin: the camera stage alone, and the sheet with that camera held."""
    noise = noise_model(rig)
    camera = camera_alone(rig, noise)[0].state
    start = with_sheets(rig, evidence(rig), camera)
    lying = {"plane": rig.observations.plane}
    return fitted(rig, lying, sheet_names(1), start, noise, "plane").state


def joint(rig: Rig, start: RigState) -> RigState:
    """The adjustment of this package."""
    free = (*intrinsic_names(rig.free_intrinsics), *ANCHOR, *sheet_names(1))
    adjustment = noise_model(rig).adjustment(rig, rig.observations.stages(), free, start)
    return settled(adjustment, start, "joint").state


def reference_start(state: RigState) -> np.ndarray:
    """The reference's parameters: alpha, beta, u0, v0, A, plane (azimuth, elevation, d), then
    theta, phi of every pivoting target and x, y, psi of every target in the sheet."""
    camera = state.camera
    (plane,) = state.light_planes(("laser",))
    normal, distance = plane.normal, plane.distance_mm
    directions = state.poses["camera"]
    pivot = np.stack(
        [np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])], axis=1
    )
    angles = np.array([np.arctan2(normal[1], normal[0]), np.arcsin(normal[2])])
    e1, e2 = _sheet_axes(angles)
    pose, frame = state.poses["plane"], state.frames[0]
    origins = pose[:, :1] * frame[:, 0] + pose[:, 1:2] * frame[:, 1]
    along = np.cos(pose[:, 2:]) * frame[:, 0] + np.sin(pose[:, 2:]) * frame[:, 1]
    lying = np.stack([origins @ e1, origins @ e2, np.arctan2(along @ e2, along @ e1)], axis=1)
    head = [camera.alpha, camera.beta, camera.u0, camera.v0, *state.anchor, *angles, distance]
    return np.concatenate([head, pivot.ravel(), lying.ravel()])


def reference_residuals(rig: Rig) -> Callable[[np.ndarray], np.ndarray]:
    """Predicted minus observed image points as a function of the reference's parameters."""
    s = np.array(rig.target.markers_mm)
    pivoting, lying = rig.observations.camera.uv, rig.observations.plane.uv
    split = 10 + 2 * len(pivoting)

    def residuals(x: np.ndarray) -> np.ndarray:
        theta, phi = x[10:split].reshape(-1, 2).T
        t = np.stack(
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1
        )
        pivot_points = x[4:7] + s[:, None] * t[:, None, :]
        e1, e2 = _sheet_axes(x[7:9])
        normal = np.cross(e1, e2)
        a, b, psi = x[split:].reshape(-1, 3).T
        p = a[:, None] + s * np.cos(psi)[:, None]
        q = b[:, None] + s * np.sin(psi)[:, None]
        plane_points = p[..., None] * e1 + q[..., None] * e2 + x[9] * normal
        predicted = [_projected(points, x) for points in (pivot_points, plane_points)]
        return np.concatenate([(predicted[0] - pivoting).ravel(), (predicted[1] - lying).ravel()])

    return residuals


def scipy_solution(
    rig: Rig, start: RigState, jac: Literal["2-point", "3-point"] = "2-point"
) -> OptimizeResult:
    """SciPy's optimum, its tolerances at rounding.

    With its default differences (2-point) it stops where the cost is still larger than at the
    optimum, by rounding: some 1e-6 away in the least determined parameters. Central differences
    go all the way.
    """
    return least_squares(
        reference_residuals(rig),
        reference_start(start),
        jac=jac,
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
    )


def differences(state: RigState, reference: np.ndarray) -> np.ndarray:
    """Relative differences of all shared parameters and poses."""
    ours = reference_start(state)
    wrapped = ours - reference
    angular = np.ones(len(ours), dtype=bool)
    angular[:7] = angular[9] = False
    wrapped[angular] = (wrapped[angular] + np.pi) % (2 * np.pi) - np.pi
    return np.abs(wrapped) / np.maximum(np.abs(reference), 1.0)


def _projected(points: np.ndarray, x: np.ndarray) -> np.ndarray:
    return points[..., :2] / points[..., 2:] * x[0:2] + x[2:4]


def _sheet_axes(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    azimuth, elevation = angles
    e1 = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    e2 = np.array(
        [
            -np.sin(elevation) * np.cos(azimuth),
            -np.sin(elevation) * np.sin(azimuth),
            np.cos(elevation),
        ]
    )
    return e1, e2


def timed(step: Callable[[], object]) -> float:
    """Seconds of one call."""
    begin = time.perf_counter()
    step()
    return time.perf_counter() - begin


def speed_ratio(rig: Rig, start: RigState, rounds: int = 5) -> float:
    """Median of SciPy's time, with its default differences, over ours; in turn."""
    joint(rig, start)
    ratios = []
    for _ in range(rounds):
        ours = timed(lambda: joint(rig, start))
        ratios.append(timed(lambda: scipy_solution(rig, start)) / ours)
    return float(np.median(ratios))


def seconds_per_view(counts: tuple[int, ...], rounds: int = 3) -> dict[int, float]:
    """Least seconds a view and iteration-complete adjustment, by number of views."""
    found = {}
    for count in counts:
        rig = simulated_rig(count * 3 // 4, count // 4)
        start = starting_state(rig)
        best = min(timed(lambda rig=rig, start=start: joint(rig, start)) for _ in range(rounds))
        found[count] = best / count
    return found


def main() -> None:
    """Print the tables."""
    console = Console(width=100)
    rig = simulated_rig(30, 10)
    start = starting_state(rig)
    state = joint(rig, start)
    reference = scipy_solution(rig, start, "3-point").x
    console.print(
        f"30 + 10 views: greatest relative difference {differences(state, reference).max():.1e}, "
        f"SciPy's time over ours {speed_ratio(rig, start):.0f}"
    )
    begin = reference_start(start)
    default = least_squares(reference_residuals(rig), begin, x_scale="jac").x
    ratios = [
        timed(lambda: least_squares(reference_residuals(rig), begin, x_scale="jac"))
        / timed(lambda: joint(rig, start))
        for _ in range(5)
    ]
    console.print(
        "SciPy at its default tolerances stops short of the optimum by "
        f"{differences(state, default).max():.1e}; its time over ours is then "
        f"{np.median(ratios):.0f}"
    )
    table = Table(title="Joint adjustment: time against the number of views")
    for heading in ("views", "microseconds a view", "relative to 1000 views"):
        table.add_column(heading, justify="right")
    times = seconds_per_view((100, 1000, 10_000))
    for count, seconds in times.items():
        table.add_row(str(count), f"{1e6 * seconds:.1f}", f"{seconds / times[1000]:.2f}")
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
