"""The least that any unbiased calibration from boards can miss by: the Cramér–Rao bound.

Nothing of this package's solver is in it: the information of every corner and of every point of
the line, by central differences of their errors at the truth, with the boards' poses eliminated.
The camera has alpha, beta, u0, v0 and Brown's five coefficients; the sheet a tilt and a distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.board_poses import placed_points
from sheetoflight.simulation.board_views import PlacedBoards

_FREE = [k for k, name in enumerate(Camera.PARAMETERS) if name != "gamma"]
_CAMERA_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-2, 1e-5, 1e-5, 1e-6, 1e-6, 1e-4])
_SHEET_STEPS = np.array([1e-6, 1e-6, 1e-3])
_POSE_STEPS = np.array([1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3])
_PIXEL_STEP = 1e-3
SHARED_STEPS = np.concatenate([_CAMERA_STEPS, _SHEET_STEPS])


@dataclass(frozen=True)
class Sensor:
    """A camera and a sheet of light."""

    camera: Camera
    plane: LightPlane

    def moved(self, step: Array) -> Sensor:
        """The sensor with nine parameters of its camera, and tilt and distance of its sheet,
        changed by ``(12,)``."""
        parameters = self.camera.parameters.copy()
        parameters[_FREE] += step[:9]
        tilt = np.stack(tangent_basis(self.plane.normal))
        normal = self.plane.normal + step[9:11] @ tilt
        plane = LightPlane(normal / np.linalg.norm(normal), self.plane.distance_mm + step[11])
        return Sensor(self.camera.with_parameters(parameters), plane)


def differences(function: Callable[[Array], Array], steps: Array) -> Array:
    """Central differences ``(..., k)`` of a function of k numbers at 0."""
    moves = np.diag(steps)
    columns = [
        (function(move) - function(-move)) / (2.0 * step)
        for move, step in zip(moves, steps, strict=True)
    ]
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Boards:
    """Boards as they were placed, and what the camera sees of them without noise.

    Parameters
    ----------
    board : PlanarBoard
    placed : PlacedBoards
    sensor : Sensor
        The truth.
    pixel_std, line_std : float
        Standard deviations of a corner's coordinates and of a line's point across the line, px.
    """

    board: PlanarBoard
    placed: PlacedBoards
    sensor: Sensor
    pixel_std: float
    line_std: float

    def covariance(self) -> Array:
        """Least covariance ``(12, 12)`` of camera and sheet, poses unknown."""
        still, here = np.zeros(6), self.sensor
        shared = self._rows(lambda step: self._errors(here.moved(step), still), SHARED_STEPS)
        own = self._rows(lambda step: self._errors(here, step), _POSE_STEPS)
        information = np.zeros((len(SHARED_STEPS),) * 2)
        for a, b in zip(shared, own, strict=True):
            rest = a - b @ np.linalg.lstsq(b, a, rcond=None)[0]
            information += rest.T @ rest
        scale = 1.0 / np.sqrt(np.diag(information))
        return scale[:, None] * np.linalg.inv(scale[:, None] * information * scale) * scale

    def _rows(self, errors: Callable[[Array], Array], steps: Array) -> list[Array]:
        """Derivatives of each view's errors in units of their noise."""
        rows = differences(errors, steps)
        corners = rows[: self._corners.size].reshape(len(self._corners), -1, len(steps))
        line = rows[self._corners.size :] / (self._across * self.line_std)[:, None]
        view = self.placed.line.view
        return [
            np.concatenate([own / self.pixel_std, line[view == k]]) for k, own in enumerate(corners)
        ]

    @property
    def _corners(self) -> Array:
        return self.sensor.camera.project(self.placed.points)

    @property
    def _across(self) -> Array:
        """How fast a line's points leave the sheet with their pixel, mm per px."""
        uv = self.sensor.camera.project(self.placed.line.points)
        still = np.zeros(6)
        slopes = differences(
            lambda step: self._off_sheet(self.sensor, uv + step, still), np.full(2, _PIXEL_STEP)
        )
        return np.linalg.norm(slopes, axis=1)

    def _errors(self, sensor: Sensor, turn: Array) -> Array:
        """Corners, px, and distances of the line's points from the sheet, mm, one after another;
        every board is turned and shifted by ``(6,)``."""
        corners = sensor.camera.project(
            placed_points(self.board.points, *self._poses(turn)),
        )
        uv = self.sensor.camera.project(self.placed.line.points)
        return np.concatenate([corners.ravel(), self._off_sheet(sensor, uv, turn)])

    def _poses(self, turn: Array) -> tuple[Array, Array]:
        return rotation(turn[:3]) @ self.placed.rotations, self.placed.translations + turn[3:]

    def _off_sheet(self, sensor: Sensor, uv: Array, turn: Array) -> Array:
        rotations, translations = self._poses(turn)
        normal = rotations[self.placed.line.view, :, 2]
        rays = sensor.camera.unproject(uv)
        depth = np.sum(normal * translations[self.placed.line.view], axis=1)
        points = rays * (depth / np.sum(normal * rays, axis=1))[:, None]
        return points @ sensor.plane.normal - sensor.plane.distance_mm
