"""What the camera sees of boards and of the lines of light on them: points without pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.camera import Camera
from sheetoflight.simulation.board_lines import LinePoints, face_outlines, lines_on_faces
from sheetoflight.simulation.board_poses import placed_points
from sheetoflight.simulation.rig import SimulatedRig

_STEP_MM = 1e-3


@dataclass(frozen=True, eq=False)
class PlacedBoards:
    """A board in every view of a recording, and the lines of light on it, in space.

    Parameters
    ----------
    rotations : (N, 3, 3) array, translations : (N, 3) array
        ``X_camera = R X_board + t``, mm.
    points : (N, M, 3) array
        The board's points in the camera frame, mm.
    line : LinePoints
    """

    rotations: Array
    translations: Array
    points: Array
    line: LinePoints


def placed_boards(
    rig: SimulatedRig,
    board: Board,
    rotations: Array,
    translations: Array,
    line_points: int = 1000,
    lit: np.ndarray | None = None,
) -> PlacedBoards:
    """A board at given poses, and where the sheets meet its faces; see `observed_boards`."""
    outlines = [placed_points(o, rotations, translations) for o in face_outlines(board)]
    return PlacedBoards(
        rotations,
        translations,
        placed_points(board.points, rotations, translations),
        lines_on_faces(rig, outlines, line_points, lit),
    )


def photographed_boards(
    camera: Camera,
    placed: PlacedBoards,
    rng: np.random.Generator,
    pixel_std: float = 0.0,
    line_std: float = 0.0,
) -> BoardViews:
    """Image points of placed boards with independent normal noise, of the lines across them.

    Points of a line outside the picture are left out.
    """
    uv = camera.project(placed.points)
    uv = uv + rng.normal(scale=pixel_std, size=uv.shape) if pixel_std else uv
    width = max(2, len(str(len(uv) - 1)))
    return BoardViews(
        names=tuple(f"board{i:0{width}d}" for i in range(len(uv))),
        uv=uv,
        std=np.full(uv.shape[:2], pixel_std) if pixel_std else None,
        line=_line_pixels(camera, placed.line, rng, line_std),
    )


def observed_boards(
    rig: SimulatedRig,
    board: Board,
    rotations: Array,
    translations: Array,
    rng: np.random.Generator,
    pixel_std: float = 0.0,
    line_std: float = 0.0,
    line_points: int = 1000,
    lit: np.ndarray | None = None,
) -> BoardViews:
    """What is seen of a board at given poses.

    Parameters
    ----------
    rig : SimulatedRig
    board : PlanarBoard or SolidTarget
    rotations : (N, 3, 3) array, translations : (N, 3) array
        ``X_camera = R X_board + t``, mm; see `board_poses`.
    rng : numpy.random.Generator
    pixel_std : float
        Standard deviation of both coordinates of the board's points, px.
    line_std : float
        Standard deviation of the line's points across the line, px.
    line_points : int
        Number of points on each laser's line, evenly along its picture.
    lit : (N, lasers) mask, optional
        Which lasers shine in which view; by default all.

    Returns
    -------
    BoardViews
        Its ``std`` are those given, NaN where 0.
    """
    placed = placed_boards(rig, board, rotations, translations, line_points, lit)
    return photographed_boards(rig.camera, placed, rng, pixel_std, line_std)


def _line_pixels(
    camera: Camera, line: LinePoints, rng: np.random.Generator, std: float
) -> LinePixels:
    uv = camera.project(line.points)
    along = camera.project(line.points + _STEP_MM * line.along) - uv
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    uv = uv + rng.normal(scale=std, size=(len(uv), 1)) * across if std else uv
    inside = ((uv >= 0) & (uv <= np.array(camera.image_size) - 1.0)).all(axis=1)
    stds = np.full(len(uv), std if std else np.nan)
    pixels = LinePixels(uv, stds, line.view, line.laser, line.face)
    return pixels.take(np.flatnonzero(inside))
