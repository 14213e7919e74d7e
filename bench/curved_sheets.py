"""Whether a sheet of light is taken for curved, and what that does to lengths.

Flat sheets, and cones of several half angles 700 mm from their apex, seen on 12 boards of 11 × 8
corners, 0.1 px; and flat sheets seen on boards that are bowed, which no one knows of. Prints how
often the sheet was taken for curved, and the rms error of lengths in the sheet as it is chosen
and with ``--flat``. Run with ``python -m bench.curved_sheets [TRIALS]``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.calibration.methods import CalibrationOptions, calibrate
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.board_faults import bent_boards
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from sheetoflight.simulation.light_cone import LightCone, touching_sheet
from sheetoflight.simulation.rig import SimulatedRig

TRIALS = 6
VIEWS = 12
NOISE_PX = 0.1
LINE_POINTS = 300
REACH_MM = 700.0
BEND_TURN_DEG = 30.0
HALF_ANGLES_DEG = (89.9, 89.6, 88.8)
BOWS_MM = (0.05, 0.1, 0.2, 0.5)
FLAT = board_rig(distortion=(-0.1, 0.05, 0.0, 0.0, 0.0))


def cone_rig(half_angle_deg: float) -> SimulatedRig:
    """The rig with a cone in place of its sheet."""
    plane = FLAT.light_planes[0]
    middle = plane.intersect(np.array([[0.0, 0.0, 1.0]]))[0]
    down = normalised(np.array([0.0, 1.0, 0.0]) - plane.normal[1] * plane.normal)
    shape = LightCone(middle - REACH_MM * down, plane.normal, np.radians(half_angle_deg))
    return replace(FLAT, light_planes=(touching_sheet(shape, middle),), cones=(shape,))


def recorded(truth: SimulatedRig, bow_mm: float, seed: int) -> tuple[Rig, Array, Array]:
    """What a person hands in, with some of the line's true points ``(P, 3)``, mm, and their
    images ``(P, 2)``, px."""
    board = FLAT.board
    assert isinstance(board, PlanarBoard)
    poses = board_poses(FLAT, board, VIEWS, np.random.default_rng(seed))
    placed = placed_boards(truth, board, *poses, line_points=LINE_POINTS)
    if bow_mm:
        placed = bent_boards(truth, board, placed, bow_mm, BEND_TURN_DEG)
    rng = np.random.default_rng([seed, 1])
    seen = photographed_boards(truth.camera, placed, rng, NOISE_PX, NOISE_PX)
    points = placed.line.points[::31]
    rig = Rig(CollinearTarget(), truth.camera.image_size, "radial2", board=board)
    return (
        replace(rig, observations=Observations(board=seen)),
        points,
        truth.camera.project(points),
    )


def length_error(found: Calibration, points: Array, uv: Array) -> float:
    """Root mean square error of lengths between the points, paired at random, mm."""
    ends = np.random.default_rng(0).permutation(len(points))
    measured = found.triangulate(uv)
    off = np.linalg.norm(measured - measured[ends], axis=1)
    off -= np.linalg.norm(points - points[ends], axis=1)
    return float(np.sqrt(np.mean(off**2)))


def trials(truth: SimulatedRig, bow_mm: float, count: int) -> Iterator[tuple[bool, float, float]]:
    """Of each: whether the sheet was taken for curved, errors as chosen and with planes, mm."""
    for seed in range(count):
        rig, points, uv = recorded(truth, bow_mm, seed)
        chosen = calibrate(rig)
        plane = calibrate(rig, options=CalibrationOptions(flat=True))
        curved = chosen.light_plane.curvature is not None
        yield curved, length_error(chosen, points, uv), length_error(plane, points, uv)


def main(count: int = TRIALS) -> None:
    """Print the table."""
    table = Table(title=f"Is the sheet curved? {count} trials of {VIEWS} boards, {NOISE_PX:g} px")
    for heading in ("sheet", "board", "taken for curved", "error as chosen, mm", "--flat, mm"):
        table.add_column(heading, justify="left" if heading in ("sheet", "board") else "right")
    cases = [("flat", FLAT, 0.0)]
    cases += [(f"cone, {angle:g}°", cone_rig(angle), 0.0) for angle in HALF_ANGLES_DEG]
    cases += [("flat", FLAT, bow) for bow in BOWS_MM]
    for sheet, truth, bow in cases:
        curved, chosen, plane = np.array(list(trials(truth, bow, count))).T
        board = f"bowed by {bow:g} mm" if bow else "flat"
        errors = (f"{np.sqrt(np.mean(e**2)):.3f}" for e in (chosen, plane))
        table.add_row(sheet, board, f"{int(curved.sum())}", *errors)
    Console(width=100).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
