"""How well a bare plate that a stage moves tells a sheet of light (method self-generated).

The paper's rig with a lens, image points known to 0.1 px; the camera from 20 boards of other
pictures, or exact. A plate of 200 mm travels over 300 mm in the sheet. Prints the rms distance of
the sheet found from the true one over that field, and rms errors of lengths of 50 mm along the
line and 300 mm across it that the calibration alone causes; beside them the joint adjustment of
the same 20 boards with the line across them. Run with ``python -m bench.self_generated [TRIALS]``.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.calibration.methods import calibrate
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.board_poses import SHEET_OF_PAPER, board_poses, board_rig
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views

TRIALS = 20
BOARDS = 20
NOISE_PX = 0.1
STAGE_MM = 0.02
TRUTH = board_rig(SHEET_OF_PAPER, (-0.1, 0.05, 0.0, 0.0, 0.0))
FIELD = SteppedPlate(np.linspace(-100, 100, 5).tolist(), np.linspace(-150, 150, 5).tolist())


def boards(seed: int) -> Rig:
    """What 20 boards with the line across them show."""
    rng = np.random.default_rng(seed)
    poses = board_poses(TRUTH, SHEET_OF_PAPER, BOARDS, rng)
    seen = observed_boards(TRUTH, SHEET_OF_PAPER, *poses, rng, NOISE_PX, NOISE_PX, 200)
    size, seen = TRUTH.camera.image_size, Observations(board=seen)
    return Rig(CollinearTarget(), size, "radial2", board=SHEET_OF_PAPER, observations=seen)


def without_line(rig: Rig) -> Rig:
    """The same boards, the laser off."""
    unlit = replace(rig.observations.board, line=LinePixels())
    return replace(rig, lasers=(), observations=Observations(board=unlit))


def by_plate(rig: Rig, steps: int, stage_mm: float, seed: int) -> Calibration:
    """The sheet by a plate of so many steps, with the rig's camera."""
    plate = SteppedPlate(travel_mm=np.linspace(-150, 150, steps).tolist())
    rng = np.random.default_rng([seed, steps])
    views = stepped_plate_views(TRUTH, plate, rng, NOISE_PX, stage_mm)
    return calibrate(replace(rig, observations=Observations(board=views)), "self-generated")


def errors(found: Calibration) -> Array:
    """Mean square errors: of the sheet's place, of 50 mm and of 300 mm, mm²."""
    truth = FIELD.points(TRUTH)
    points = found.triangulate(TRUTH.camera.project(truth).reshape(-1, 2)).reshape(truth.shape)
    short = np.linalg.norm(points[:, 1:] - points[:, :-1], axis=2) - 50.0
    long = np.linalg.norm(points[-1] - points[0], axis=1) - 300.0
    off = found.light_plane.heights(truth)
    return np.array([np.mean(part**2) for part in (off, short, long)])


def main(count: int = TRIALS) -> None:
    """Print the table."""
    squares: dict[tuple[str, str], list[Array]] = {}
    for seed in range(count):
        whole = boards(seed)
        unlit = calibrate(without_line(whole))
        bare = Rig(CollinearTarget(), TRUTH.camera.image_size, pixel_std=NOISE_PX)
        held = replace(bare, camera=unlit.camera, camera_covariance=unlit.covariance)
        exact = replace(bare, camera=TRUTH.camera)
        for camera, rig in (("exact", exact), ("of 20 boards", held)):
            for steps, stage in ((2, 0.0), (5, 0.0), (20, 0.0), (20, STAGE_MM)):
                what = f"plate, {steps} steps" + (f", stage {stage:g} mm" if stage else "")
                found = by_plate(rig, steps, stage, seed)
                squares.setdefault((what, camera), []).append(errors(found))
        joint = ("20 boards with the line, joint", "found with it")
        squares.setdefault(joint, []).append(errors(calibrate(whole)))
    table = Table(title=f"A plate on a stage: {count} trials, {NOISE_PX:g} px")
    for heading in ("method", "camera", "sheet, mm rms", "50 mm", "300 mm"):
        table.add_column(heading, justify="left" if heading in ("method", "camera") else "right")
    for names, each in squares.items():
        table.add_row(*names, *(f"{value:.3f}" for value in np.sqrt(np.mean(each, axis=0))))
    Console(width=100).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
