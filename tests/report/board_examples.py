"""Plausible calibrations from views of a printed board, with and without the laser's line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.covariance import PLANE_PARTS, Covariance, NoiseComponents, Source
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import PlacedBoards, placed_boards

CORNER_PX, STRIPE_PX, LINE_MM = 0.17, 0.19, 0.05
BOARD = PlanarBoard("chessboard", 11, 8, (12.0, 12.0))
RIG = board_rig(BOARD)
COMPONENTS = {"corner": (CORNER_PX, 2000.0), "stripe": (STRIPE_PX, 5000.0), "line": (LINE_MM, 10.0)}
"""Estimated noise: its size, and degrees of freedom."""

SOURCES = {
    "board": "corner",
    "line": "stripe",
    "lines off the sheet": "line",
    "board length": None,
    "board print": None,
}
"""Sources and the noise component that each goes with."""

CAMERA_SOURCES = {"board": "corner", "board print": None}


def board_calibration(count: int = 6, **changes: Any) -> Calibration:
    """Camera and sheet from boards with the line across them."""
    made = Calibration(
        method="joint",
        camera=RIG.camera,
        light_planes=RIG.light_planes,
        covariance=covariance(SOURCES, tuple(COMPONENTS)),
        residuals=Residuals(CORNER_PX, 1.0, board_views(count)),
        target=None,
        pixel_std=CORNER_PX,
    )
    return replace(made, **changes)


def camera_calibration(count: int = 6, **changes: Any) -> Calibration:
    """A camera and no sheet of light."""
    alone = board_calibration(
        count, light_planes=(), covariance=covariance(CAMERA_SOURCES, ("corner",), planes=False)
    )
    return replace(alone, **changes)


def boards_in_space(count: int) -> PlacedBoards:
    """Boards that the sheet crosses, and the lines on them."""
    rng = np.random.default_rng(20111101)
    return placed_boards(RIG, BOARD, *board_poses(RIG, BOARD, count, rng))


def board_views(count: int) -> tuple[ViewResiduals, ...]:
    """Views with normal residuals; in the first one point is not seen."""
    rng = np.random.default_rng(20111102)
    views = []
    for number, xyz in enumerate(boards_in_space(count).points):
        residuals = rng.normal(scale=CORNER_PX, size=(len(xyz), 2))
        if number == 0:
            residuals[40] = np.nan
        uv = RIG.camera.project(xyz) + residuals
        views.append(ViewResiduals("board", f"frame{number:02d}", uv, residuals, xyz))
    return tuple(views)


def covariance(
    shares: dict[str, str | None], components: tuple[str, ...], planes: bool = True
) -> Covariance:
    """Each source moves all parameters in three random ways."""
    rng = np.random.default_rng(20111103)
    names = [f"camera.{name}" for name in ("alpha", "beta", "u0", "v0")]
    scales = [1.0, 1.0, 1.5, 1.5]
    if planes:
        names += [f"laser.{part}" for part in PLANE_PARTS]
        scales += [2e-4, 2e-4, 2e-4, 0.2]
    sources = []
    for name, component in shares.items():
        ways = np.array(scales)[:, None] * rng.normal(size=(len(names), 3))
        sources.append(Source(name, ways @ ways.T, component))
    whole = np.sum([source.matrix for source in sources], axis=0)
    sizes = tuple(COMPONENTS[name][0] for name in components)
    relative = np.diag([2.0 / COMPONENTS[name][1] for name in components])
    return Covariance(
        tuple(names), whole, tuple(sources), NoiseComponents(components, sizes, relative)
    )
