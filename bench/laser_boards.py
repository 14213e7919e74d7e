"""Camera and sheet of light from boards with the line across them: errors and times, by this
package and by what people use instead, beside the Cramér–Rao bound.

The paper's rig with a distorting lens; 20 views of a chessboard of 88 corners with 1000 points of
the line on each, noise of 0.1 px on both. All methods see the same data. Then with two faults:
lines that lie off the sheet by 0.1 mm (standard deviation) as wholes, and lines that go on beyond
the board by 5 % of their points. Errors are root mean squares, of lengths means of absolute values,
each with its ratio to the bound of the data without fault. A length's ends are perfect in the
picture. Times are those of the whole calibration, points and line found before, as ratios to
``cv2.calibrateCamera`` on the corners alone in the same round; medians.

Boards are tilted up to 30°, and up to 50°. Where a line runs more along the depth than along x or
y, vision-calibration 0.9's default residual is a constant of a million px, which ends its search
too early: that happens on some boards of the larger tilts only.

Run with ``python -m bench.laser_boards [TRIALS] [--quick]``; ``--quick`` leaves out
vision-calibration, which takes some 20 s a calibration.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from bench._laser_boards_bound import SHARED_STEPS, Boards, Sensor, differences
from bench._laser_boards_peers import METHODS, QUICK, Found, Told, installed
from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.board import PlanarBoard
from sheetoflight.simulation.board_faults import lines_beyond, shifted_lines
from sheetoflight.simulation.board_poses import SHEET_OF_PAPER, BoardHolding, board_poses, board_rig
from sheetoflight.simulation.board_views import PlacedBoards, photographed_boards, placed_boards
from sheetoflight.simulation.poses import points_in_sheet, segments_in_sheet
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.visible import in_picture

SEED = 5
TRIALS, ROUNDS = 20, 7
VIEWS, LINE_POINTS = 20, 1000
STD_PX = 0.1
BROWN = (-0.1, 0.05, 0.0008, -0.0005, 0.01)
LENGTHS_MM = (150.0, 450.0)
SEGMENTS = 100
OFFSET_MM = 0.1
BEYOND = 50
"""Points of a line beyond the board."""

QUANTITIES = ("angle °", "sheet mm", "150 mm", "450 mm", "alpha px")
_ABSOLUTE = ("150 mm", "450 mm")
_MEAN_OF_ROOT = np.sqrt(2.0 / np.pi)
"""Mean size of a normal deviation, in standard deviations."""

_ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1"
)
_SLOW_S = 1.0
"""A method that takes longer is timed once."""


@dataclass(frozen=True)
class Gauge:
    """What a calibration is judged by: points of the sheet and segments in it, both in view.

    Parameters
    ----------
    truth : Sensor
    points : (P, 3) array
        mm.
    ends : mapping from length to (S, 2, 2) array
        Image points of the segments' ends, px.
    """

    truth: Sensor
    points: Array
    ends: Mapping[str, Array]

    def read(self, sensor: Sensor) -> dict[str, Array]:
        """The quantities of a sensor; angles against the true normal, in degrees."""
        return {
            "angle °": np.degrees(np.stack(tangent_basis(self.truth.plane.normal)))
            @ sensor.plane.normal,
            "sheet mm": self.points @ sensor.plane.normal - sensor.plane.distance_mm,
            **{name: _lengths(sensor, uv) for name, uv in self.ends.items()},
            "alpha px": np.array([sensor.camera.alpha]),
        }

    def errors(self, found: Found) -> dict[str, Array]:
        """What a method misses by; a camera alone has but its focal length."""
        if found.plane is None:
            return {"alpha px": np.array([found.camera.alpha - self.truth.camera.alpha])}
        true = self.read(self.truth)
        return {
            name: values - true[name]
            for name, values in self.read(Sensor(found.camera, found.plane)).items()
        }

    def least(self, covariance: Array) -> dict[str, Array]:
        """Standard deviations that the bound leaves them, of covariance ``(12, 12)``."""
        slopes = {
            name: differences(lambda s, n=name: self.read(self.truth.moved(s))[n], SHARED_STEPS)
            for name in QUANTITIES
        }
        return {n: np.sqrt(np.sum((s @ covariance) * s, axis=1)) for n, s in slopes.items()}


def _lengths(sensor: Sensor, uv: Array) -> Array:
    ends = sensor.plane.intersect(sensor.camera.unproject(uv).reshape(-1, 3)).reshape(-1, 2, 3)
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def gauge(rig: SimulatedRig, rng: np.random.Generator) -> Gauge:
    """Points and segments all over the field of measurement."""
    points = points_in_sheet(rig, 2000, rng)
    ends = {
        f"{length:g} mm": rig.camera.project(segments_in_sheet(rig, length, SEGMENTS, rng))
        for length in LENGTHS_MM
    }
    seen = points[in_picture(rig.camera, points, 0.0)]
    return Gauge(Sensor(rig.camera, rig.light_plane), seen, ends)


@dataclass(frozen=True)
class Trial:
    """Boards held before the camera, and what is seen of them without fault and with either."""

    boards: Boards
    told: Mapping[str, Told]


def trial(rig: SimulatedRig, max_tilt_deg: float, number: int) -> Trial:
    """One trial's data; a number is a seed."""
    board, rng = SHEET_OF_PAPER, np.random.default_rng([SEED, number])
    poses = board_poses(rig, board, VIEWS, rng, BoardHolding(max_tilt_deg=max_tilt_deg))
    placed = placed_boards(rig, board, *poses, LINE_POINTS)
    offsets = rng.normal(scale=OFFSET_MM, size=VIEWS)
    kinds = {
        "no fault": placed,
        f"lines off by {OFFSET_MM:g} mm": shifted_lines(board, placed, offsets),
        "5 % beyond the board": lines_beyond(rig, board, placed, line_points=BEYOND),
    }
    seen = {name: _told(rig, board, kind, rng) for name, kind in kinds.items()}
    truth = Sensor(rig.camera, rig.light_plane)
    return Trial(Boards(board, placed, truth, STD_PX, STD_PX), seen)


def _told(
    rig: SimulatedRig, board: PlanarBoard, placed: PlacedBoards, rng: np.random.Generator
) -> Told:
    views = photographed_boards(rig.camera, placed, rng, STD_PX, STD_PX)
    return Told(board, views, rig.camera.image_size)


def error_table(
    names: Sequence[str], trials: Sequence[Trial], kind: str, judge: Gauge, title: str
) -> Table:
    """Errors of every method and the bound; a row's name says how many trials it refused."""
    least = [judge.least(one.boards.covariance()) for one in trials]
    bound = {n: _size(n, np.concatenate([each[n] for each in least]), True) for n in QUANTITIES}
    table = Table(title=title, box=box.MARKDOWN, title_justify="left")
    table.add_column("method")
    for name in QUANTITIES:
        table.add_column(name, justify="right")
    table.add_row("Cramér–Rao bound", *(f"{bound[name]:.4f}" for name in QUANTITIES))
    for name in names:
        found = [_errors(name, one.told[kind], judge) for one in trials]
        good = [errors for errors in found if errors is not None]
        refused = f" ({len(found) - len(good)} refused)" if len(good) < len(found) else ""
        table.add_row(name + refused, *(_cell(quantity, good, bound) for quantity in QUANTITIES))
    return table


def _errors(name: str, told: Told, judge: Gauge) -> dict[str, Array] | None:
    run, read = METHODS[name](told)
    try:
        return judge.errors(read(run()))
    except Exception as reason:  # each method refuses in its own way
        print(f"{name}: {reason}", file=sys.stderr)
        return None


def _cell(quantity: str, found: Sequence[dict[str, Array]], bound: Mapping[str, float]) -> str:
    values = [errors[quantity] for errors in found if quantity in errors]
    if not values:
        return "–"
    size = _size(quantity, np.concatenate(values), False)
    return f"{size:.4f} ({size / bound[quantity]:.2f})"


def _size(quantity: str, values: Array, are_std: bool) -> float:
    """Root mean square, or mean size; of errors, or of normal errors with these deviations."""
    if quantity in _ABSOLUTE:
        return float(np.mean(np.abs(values)) * (_MEAN_OF_ROOT if are_std else 1.0))
    # an angle is the length of two components
    parts = 2.0 if quantity == "angle °" else 1.0
    return float(np.sqrt(parts * np.mean(values**2)))


def times(
    names: Sequence[str], told: Told, rounds: int, one_thread: bool
) -> dict[str, list[float]]:
    """Seconds of each method, in turn; of slow ones, once."""
    cv2.setNumThreads(1 if one_thread else -1)
    runs = {name: METHODS[name](told)[0] for name in names}
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for name in QUICK:
        runs[name]()
    for _ in range(rounds):
        for name, run in runs.items():
            if min(seconds[name], default=0.0) > _SLOW_S and name not in QUICK:
                continue
            begin = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - begin)
    return seconds


def time_table(names: Sequence[str]) -> Table:
    """Times with one thread and with as many as each method takes, each in a process of its own."""
    table = Table(title="Times", box=box.MARKDOWN, title_justify="left")
    for heading in ("method", "1 thread, ms", "ratio", "threads by default, ms", "ratio"):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    columns = [_times_apart(names, one) for one in (True, False)]
    for name in names:
        table.add_row(name, *(part for seconds in columns for part in _time_cells(seconds, name)))
    return table


def _times_apart(names: Sequence[str], one_thread: bool) -> dict[str, list[float]]:
    command = [sys.executable, "-m", "bench.laser_boards", "--times", json.dumps(list(names))]
    others = {name: value for name, value in os.environ.items() if name not in _ONE_THREAD}
    environment = {**others, **(_ONE_THREAD if one_thread else {})}
    command += ["--one-thread"] if one_thread else []
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def _time_cells(seconds: Mapping[str, list[float]], name: str) -> tuple[str, str]:
    own = np.array(seconds[name])
    reference = np.array(seconds["cv2.calibrateCamera alone"])[: len(own)]
    return f"{1e3 * np.median(own):.1f}", f"{np.median(own / reference):.1f}"


def main() -> None:
    """Print the tables."""
    rig = board_rig(distortion=BROWN)
    if "--times" in sys.argv:
        names = json.loads(sys.argv[sys.argv.index("--times") + 1])
        told = trial(rig, 30.0, 0).told["no fault"]
        print(json.dumps(times(names, told, ROUNDS, "--one-thread" in sys.argv)))
        return
    count = next((int(word) for word in sys.argv[1:] if word.isdigit()), TRIALS)
    names = QUICK if "--quick" in sys.argv else installed()
    console, judge = Console(width=140), gauge(rig, np.random.default_rng(SEED))
    for tilt in (30.0, 50.0):
        trials = [trial(rig, tilt, number) for number in range(count)]
        for kind in trials[0].told if tilt == 30.0 else ("no fault",):
            title = f"Boards tilted up to {tilt:g}°, {kind}, {count} trials: error (ratio to bound)"
            console.print(error_table(names, trials, kind, judge, title))
    console.print(time_table(names))


if __name__ == "__main__":
    main()
