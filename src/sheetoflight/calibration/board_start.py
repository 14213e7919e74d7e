"""Where the adjustment of boards begins: camera, poses and sheets from the boards alone.

A flat board gives a homography a view, and these the camera in closed form (Zhang 2000); a solid
body gives a projection matrix. The points alone are adjusted first, for they leave nothing open;
then the line's points are put onto the boards, and a plane through them is the sheet.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_closed_form import homographies, pose_from_homography
from sheetoflight.calibration.camera_closed_form import closed_form_cameras, normalisation
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import settled
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.solid_closed_form import dlt_camera
from sheetoflight.calibration.starts import plain_cameras
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import Solution, SolverOptions
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig

_ROUGHLY = SolverOptions(tolerance=1e-5)
"""For what is only where the next adjustment begins."""


def boards_alone(rig: Rig) -> Solution[RigState]:
    """Camera and poses that fit the points of the boards, lines left aside.

    Raises
    ------
    UntrustworthyError
        If the views give no camera.
    """
    points = replace(rig.observations.board, line=LinePixels())
    alone = replace(rig, observations=Observations(board=points))
    task = EstimationTask(alone, noise_model(alone), {}, (), "board")
    best: Solution[RigState] | None = None
    maps = _image_maps(alone)
    for camera in _cameras(alone, maps):
        poses = board_poses(alone, camera, maps)
        if not np.isfinite(poses).all():
            continue
        state = replace(no_sheets(camera), poses={"board": poses})
        solution = _adjusted(task, state)
        if best is None or solution.cost < best.cost:
            best = solution
        if best.converged:
            break
    if best is None:
        raise UntrustworthyError(
            "board",
            "no camera sees the boards as the pictures show them",
            "tilt the board by 20° to 50° to all sides; check columns, rows and pitch_mm under "
            "[board] in rig.toml",
        )
    return best


def _adjusted(task: EstimationTask, state: RigState) -> Solution[RigState]:
    """All at once, or, where that goes astray, first without distortion."""
    noise, rig = task.noise, task.rig
    solution = settled(noise.adjustment(rig, {}, task.free, state), state, "board", _ROUGHLY)
    if solution.converged or task.free == task.without_distortion:
        return solution
    first = settled(noise.adjustment(rig, {}, task.without_distortion, state), state, "board")
    again = settled(noise.adjustment(rig, {}, task.free, first.state), first.state, "board")
    return min(solution, again, key=lambda s: s.cost)


def no_sheets(camera: Camera) -> RigState:
    """A state of a camera alone."""
    return RigState(camera, np.array([0.0, 0.0, 1.0]), np.zeros((0, 3, 3)), np.zeros(0), {})


@dataclass(frozen=True)
class _ImageMaps:
    """Homographies ``(N, 3, 3)`` from a flat board to the image in coordinates of about 1, and
    what makes such of px ``(3, 3)``."""

    maps: Array
    pixels: Array


def _image_maps(rig: Rig) -> _ImageMaps | None:
    """None for solid bodies, and where a lens is known that bends the image."""
    if rig.camera is not None or not isinstance(rig.board, PlanarBoard):
        return None
    uv = rig.observations.board.uv
    pixels = normalisation(uv.reshape(-1, 2))
    return _ImageMaps(homographies(rig.board.points, uv * pixels[0, 0] + pixels[:2, 2]), pixels)


def _cameras(rig: Rig, image: _ImageMaps | None) -> Iterator[Camera]:
    """Cameras worth trying, the best founded first."""
    if rig.camera is not None:
        yield rig.camera
        return
    if image is not None:
        maps, pixels = image.maps, image.pixels
        maps = maps[np.isfinite(maps).all(axis=(1, 2))]
        middle = 0.5 * (np.array(rig.image_size) - 1.0) * pixels[0, 0] + pixels[:2, 2]
        found = closed_form_cameras(np.zeros((0, 3)), list(maps), middle, rig.skew)
        matrices = (np.linalg.solve(pixels, matrix) for matrix in found)
    else:
        matrices = _projected(rig)
    for matrix in matrices:
        if not rig.skew:
            matrix[0, 1] = 0.0
        matrix[1, 0] = 0.0
        matrix[2] = 0.0, 0.0, 1.0
        yield Camera.from_matrix(rig.image_size, matrix)
    yield from plain_cameras(rig)


def _projected(rig: Rig) -> list[Array]:
    """The median K of the views' projection matrices."""
    assert rig.board is not None
    found = []
    for uv in rig.observations.board.uv:
        seen = np.isfinite(uv).all(axis=1)
        result = dlt_camera(rig.board.points[seen], uv[seen]) if seen.sum() >= 6 else None
        if result is not None:
            found.append(result[0])
    return [np.median(found, axis=0)] if found else []


def board_poses(rig: Rig, camera: Camera, image: _ImageMaps | None = None) -> Array:
    """Poses ``(N, 3, 4)`` of the boards for a camera; NaN where a view gives none.

    Where the maps to the image are known, the camera's lens must not bend it.
    """
    assert rig.board is not None
    if image is not None:
        return _as_poses(pose_from_homography(image.pixels @ camera.matrix, image.maps))
    views, board = rig.observations.board, rig.board
    xy = camera.unproject(views.uv)[..., :2]
    if isinstance(board, PlanarBoard):
        return _as_poses(pose_from_homography(np.eye(3), homographies(board.points, xy)))
    poses = np.full((len(views), 3, 4), np.nan)
    for index, view in enumerate(xy):
        seen = np.isfinite(view).all(axis=1)
        result = dlt_camera(board.points[seen], view[seen]) if seen.sum() >= 6 else None
        if result is not None:
            poses[index] = result[1]
    return poses


def _as_poses(parts: tuple[Array, Array]) -> Array:
    return np.concatenate([parts[0], parts[1][..., None]], axis=2)
