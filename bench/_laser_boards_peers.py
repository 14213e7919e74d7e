"""What people calibrate a camera and a sheet of light with from boards: OpenCV scripts, and the
package vision-calibration.

All are told the same: the board, the picture's size, and that the lens has Brown's five
coefficients. vision-calibration is a front to calibration-rs; ``pip install vision-calibration``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import cv2
import numpy as np

from sheetoflight.calibration.methods import calibrate
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class Told:
    """What every method is told: the board, its views, and the picture's size in px."""

    board: PlanarBoard
    views: BoardViews
    image_size: tuple[int, int]


@dataclass(frozen=True)
class Found:
    """What a method makes of it; `plane` is None where it calibrates the camera alone."""

    camera: Camera
    plane: LightPlane | None


Run = Callable[[], Any]
Reading = Callable[[Any], Found]
Prepared = tuple[Run, Reading]
"""The calibration itself, which is timed, and how its result reads, which is not."""


def ours(told: Told) -> Prepared:
    """`calibrate` with default settings: the noise is estimated from the residuals."""
    rig = Rig(
        CollinearTarget(),
        told.image_size,
        distortion="brown",
        board=told.board,
        observations=Observations(board=told.views),
    )
    return lambda: calibrate(rig), lambda result: Found(result.camera, result.light_plane)


def opencv_camera(told: Told) -> Prepared:
    """``cv2.calibrateCamera`` on the corners; no sheet."""
    objects, images = _for_opencv(told)
    size = told.image_size

    def read(result: Any) -> Found:
        return Found(Camera.from_matrix(size, result[1], result[2].ravel()[:5]), None)

    return lambda: _calibrate_camera(objects, images, size), read


def opencv_script(told: Told) -> Prepared:
    """The script of many tutorials: the camera from the corners, each board's pose by
    ``cv2.solvePnP``, the line's points put onto the boards, a plane through all by SVD."""
    objects, images = _for_opencv(told)
    lines = _line_pixels(told)

    def run() -> tuple[Array, Array, Array, float]:
        _, matrix, distortion, *_ = _calibrate_camera(objects, images, told.image_size)
        points = [
            _on_board(told.board, image, line, matrix, distortion)
            for image, line in zip(images, lines, strict=True)
        ]
        return matrix, distortion, *_plane_through(np.concatenate(points))

    def read(result: tuple[Array, Array, Array, float]) -> Found:
        matrix, distortion, normal, distance = result
        camera = Camera.from_matrix(told.image_size, matrix, distortion.ravel()[:5])
        return Found(camera, LightPlane(normal, distance))

    return run, read


def _for_opencv(told: Told) -> tuple[list[Array], list[Array]]:
    objects = [told.board.points.astype(np.float32)] * len(told.views)
    return objects, [np.ascontiguousarray(uv, dtype=np.float32) for uv in told.views.uv]


def _calibrate_camera(objects: list[Array], images: list[Array], size: tuple[int, int]) -> Any:
    function: Any = cv2.calibrateCamera  # its stubs do not know that None asks for a new matrix
    return function(objects, images, size, None, None)


def _line_pixels(told: Told) -> list[Array]:
    line = told.views.line
    return [line.uv[line.view == view] for view in range(len(told.views))]


def _on_board(
    board: PlanarBoard, image: Array, line: Array, matrix: Array, distortion: Array
) -> Array:
    """Points ``(P, 3)`` of a line on a board, camera frame, mm."""
    _, turn, shift = cv2.solvePnP(board.points, image.astype(float), matrix, distortion)
    normal = cv2.Rodrigues(turn)[0][:, 2]
    xy = cv2.undistortPoints(line[:, None].copy(), matrix, distortion)[:, 0]
    rays = np.column_stack([xy, np.ones(len(xy))])
    return rays * (normal @ shift.ravel() / (rays @ normal))[:, None]


def _plane_through(points: Array) -> tuple[Array, float]:
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    return _facing_away(normal, float(normal @ middle))


def _facing_away(normal: Array, distance: float) -> tuple[Array, float]:
    return (normal, distance) if distance > 0 else (-normal, -distance)


@dataclass(frozen=True)
class VisionCalibration:
    """vision-calibration's ``run_laserline_device``: camera, poses and sheet in one adjustment.

    As it comes, it holds the first pose where its start has put it, does not estimate k3, and
    takes a line's points by Huber's function with a scale of 0.01 px, which is all but the sum of
    their distances.

    Parameters
    ----------
    pose_free : bool
        Whether the first pose is estimated like the others.
    squares : bool
        Whether k3 is estimated too, and squares are minimised: best for normal noise.
    """

    pose_free: bool = False
    squares: bool = False

    def __call__(self, told: Told) -> Prepared:
        """The call on ready-made views of its own kind."""
        vc = import_module("vision_calibration")
        views, config = self._views(vc, told), self._config(vc)

        def read(result: Any) -> Found:
            return _read_vision_calibration(result.estimate.params, told.image_size)

        return lambda: vc.run_laserline_device(views, config), read

    def _views(self, vc: Any, told: Told) -> Any:
        board = told.board.points.tolist()
        views = []
        for uv, line in zip(told.views.uv, _line_pixels(told), strict=True):
            weights = [1.0] * len(line)  # said to be optional, but without them the call fails
            seen = vc.Observation(board, uv.tolist())
            views.append(vc.LaserlineView(seen, line.tolist(), weights))
        return vc.LaserlineDataset(views)

    def _config(self, vc: Any) -> Any:
        config = vc.LaserlineDeviceCalibrationConfig()
        if self.pose_free:
            config.optimize.fix_poses = []
        if self.squares:
            config.optimize.calib_loss = config.optimize.laser_loss = "None"
            config.optimize.fix_camera.distortion["k3"] = False
        return config


def _read_vision_calibration(params: Any, size: tuple[int, int]) -> Found:
    k, d = params.intrinsics, params.distortion
    camera = Camera(size, k.fx, k.fy, k.cx, k.cy, k.skew, (d.k1, d.k2, d.p1, d.p2, d.k3))
    # theirs is n · X + d = 0
    normal, distance = np.array(params.plane.normal_xyz), -params.plane.distance
    return Found(camera, LightPlane(*_facing_away(normal, distance)))


METHODS: Mapping[str, Callable[[Told], Prepared]] = {
    "ours": ours,
    "cv2.calibrateCamera alone": opencv_camera,
    "OpenCV script": opencv_script,
    "vision-calibration, as it comes": VisionCalibration(),
    "the same, first pose free": VisionCalibration(pose_free=True),
    "the same, least squares, k3": VisionCalibration(pose_free=True, squares=True),
}
QUICK = tuple(METHODS)[:3]
"""Methods that take less than a second."""


def installed() -> tuple[str, ...]:
    """Names of the methods that can run here."""
    return tuple(METHODS) if find_spec("vision_calibration") else QUICK
