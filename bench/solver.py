"""The adjustment beside ``scipy.optimize.least_squares`` on the same residuals.

The reference knows nothing of this package's solver: another parametrisation (angles instead of
tangent steps), its own projection, SciPy's trust region. For the camera stage alone (200 views of
5 markers) and for both stages together (30 + 10 views of 3), prints the greatest relative
difference of a parameter and the ratio of the times in turn; then how time and memory of a whole
calibration grow with the number of views. Run with ``python -m bench.solver``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import OptimizeResult, least_squares

from sheetoflight.calibration.camera_alone import camera_alone
from sheetoflight.calibration.fit import settled
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.rig_state import ANCHOR, RigState, intrinsic_names, sheet_names
from sheetoflight.calibration.starts import cameras, evidence, pivoting_state, with_sheets
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig

SEED = 11
FIVE = CollinearTarget((0.0, 100.0, 200.0, 300.0, 400.0))


def simulated_rig(
    camera_views: int, plane_views: int, seed: int = SEED, target: CollinearTarget | None = None
) -> Rig:
    """The paper's rig with 0.1 px noise."""
    truth = paper_rig(target=target)
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


def closed_form_state(rig: Rig) -> RigState:
    """The camera stage's closed form."""
    found = evidence(rig)
    return pivoting_state(rig, found, next(cameras(rig, found)))


def joint(rig: Rig, start: RigState) -> RigState:
    """The adjustment of this package."""
    sheets = sheet_names(len(start.distances))
    free = (*intrinsic_names(rig.free_intrinsics), *ANCHOR, *sheets)
    adjustment = noise_model(rig).adjustment(rig, rig.observations.stages(), free, start)
    return settled(adjustment, start, "joint").state


def reference_start(state: RigState) -> np.ndarray:
    """The reference's parameters: alpha, beta, u0, v0, A, then theta, phi of every pivoting
    target; where there is a sheet, its azimuth, elevation and d, then x, y, psi of every target
    in it."""
    camera = state.camera
    directions = state.poses["camera"]
    pivot = np.stack(
        [np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])], axis=1
    )
    head = [camera.alpha, camera.beta, camera.u0, camera.v0, *state.anchor]
    return np.concatenate([head, pivot.ravel(), _sheet_start(state)])


def _sheet_start(state: RigState) -> np.ndarray:
    if not len(state.distances):
        return np.zeros(0)
    (plane,) = state.light_planes(("laser",))
    normal, distance = plane.normal, plane.distance_mm
    angles = np.array([np.arctan2(normal[1], normal[0]), np.arcsin(normal[2])])
    e1, e2 = _sheet_axes(angles)
    pose, frame = state.poses["plane"], state.frames[0]
    origins = pose[:, :1] * frame[:, 0] + pose[:, 1:2] * frame[:, 1]
    along = np.cos(pose[:, 2:]) * frame[:, 0] + np.sin(pose[:, 2:]) * frame[:, 1]
    lying = np.stack([origins @ e1, origins @ e2, np.arctan2(along @ e2, along @ e1)], axis=1)
    return np.concatenate([angles, [distance], lying.ravel()])


def reference_residuals(rig: Rig) -> Callable[[np.ndarray], np.ndarray]:
    """Predicted minus observed image points as a function of the reference's parameters."""
    s = np.array(rig.target.markers_mm)
    pivoting, lying = rig.observations.camera.uv, rig.observations.plane.uv
    split = 7 + 2 * len(pivoting)

    def residuals(x: np.ndarray) -> np.ndarray:
        theta, phi = x[7:split].reshape(-1, 2).T
        t = np.stack(
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1
        )
        pivot_points = x[4:7] + s[:, None] * t[:, None, :]
        off = (_projected(pivot_points, x) - pivoting).ravel()
        if not len(lying):
            return off
        plane_points = _lying_points(s, x[split : split + 3], x[split + 3 :])
        return np.concatenate([off, (_projected(plane_points, x) - lying).ravel()])

    return residuals


def _lying_points(s: np.ndarray, sheet: np.ndarray, poses: np.ndarray) -> np.ndarray:
    e1, e2 = _sheet_axes(sheet[:2])
    a, b, psi = poses.reshape(-1, 3).T
    p = a[:, None] + s * np.cos(psi)[:, None]
    q = b[:, None] + s * np.sin(psi)[:, None]
    return p[..., None] * e1 + q[..., None] * e2 + sheet[2] * np.cross(e1, e2)


def scipy_solution(
    rig: Rig,
    start: RigState,
    jac: Literal["2-point", "3-point"] = "2-point",
    tolerance: float = 1e-15,
) -> OptimizeResult:
    """SciPy's optimum; its default tolerance is 1e-8.

    With its default differences (2-point) it stops where the cost is still larger than at the
    optimum, by rounding: some 1e-6 to 1e-5 away in the least determined parameters. Central ones
    go all the way.
    """
    return least_squares(
        reference_residuals(rig),
        reference_start(start),
        method="trf",
        jac=jac,
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
    )


def differences(state: RigState, reference: np.ndarray) -> np.ndarray:
    """Relative differences of all shared parameters and poses."""
    ours = reference_start(state)
    wrapped = ours - reference
    angular = np.ones(len(ours), dtype=bool)
    angular[:7] = False
    if len(state.distances):
        angular[7 + 2 * len(state.poses["camera"]) + 2] = False
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


def speed_ratio(rig: Rig, start: RigState, rounds: int = 5, tolerance: float = 1e-15) -> float:
    """Median of SciPy's time, with its default differences, over ours; in turn."""
    joint(rig, start)
    ratios = []
    for _ in range(rounds):
        ours = timed(lambda: joint(rig, start))
        ratios.append(timed(lambda: scipy_solution(rig, start, tolerance=tolerance)) / ours)
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


def whole_calibration(rig: Rig) -> tuple[float, float]:
    """Seconds of a calibration, and the greatest memory in MB that this process has held beyond
    what it had before."""
    before = _peak_mb()
    seconds = timed(lambda: calibrate(rig))
    return seconds, _peak_mb() - before


def _peak_mb() -> float:
    """Unlike ``ru_maxrss``, Linux begins it anew for a new program."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(float(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmHWM"))


def main() -> None:
    """Print the tables."""
    console = Console(width=100)
    many, few = simulated_rig(200, 0, target=FIVE), simulated_rig(30, 10)
    table = Table(title="least_squares(method='trf'), 2-point differences")
    for heading in ("views", "difference", "time over ours", "default tolerances", "… over ours"):
        table.add_column(heading, justify="right")
    for name, rig, start in (
        ("camera alone, 200 x 5 markers", many, closed_form_state(many)),
        ("joint, 30 + 10 x 3 markers", few, starting_state(few)),
    ):
        state = joint(rig, start)
        row = [name]
        for tolerance in (1e-15, 1e-8):
            theirs = scipy_solution(rig, start, tolerance=tolerance).x
            ratio = speed_ratio(rig, start, 3, tolerance)
            row += [f"{differences(state, theirs).max():.1e}", f"{ratio:.0f}"]
        table.add_row(*row)
    console.print(table)

    table = Table(title="Joint adjustment: time against the number of views")
    for heading in ("views", "microseconds a view", "relative to 1000 views"):
        table.add_column(heading, justify="right")
    times = seconds_per_view((100, 1000, 10_000))
    for count, seconds in times.items():
        table.add_row(str(count), f"{1e6 * seconds:.1f}", f"{seconds / times[1000]:.2f}")
    console.print(table)

    table = Table(title="Whole calibration, 30 views of the camera stage")
    for heading in ("views in the sheet", "s", "MB", "kB a view"):
        table.add_column(heading, justify="right")
    for count in (10_000, 100_000):
        rig = simulated_rig(30, count)
        # memory's peak is that of a process: a new one each
        with ProcessPoolExecutor(1, get_context("spawn")) as alone:
            seconds, megabytes = alone.submit(whole_calibration, rig).result()
        kilobytes = 1024.0 * megabytes / count
        table.add_row(str(count), f"{seconds:.1f}", f"{megabytes:.0f}", f"{kilobytes:.1f}")
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
