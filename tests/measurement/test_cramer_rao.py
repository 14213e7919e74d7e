"""The bound of what a plate on a stage tells: the information of all pictures together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sheetoflight.calibration.methods import calibrate
from sheetoflight.measurement.cramer_rao import bounding_calibration
from sheetoflight.measurement.length import lengths
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import (
    SHEET_OF_PAPER,
    board_poses,
    board_rig,
    placed_points,
)
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.poses import segments_in_sheet
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views

TRUTH = board_rig(SHEET_OF_PAPER)
PLATE = SteppedPlate(travel_mm=np.linspace(-150.0, 150.0, 12).tolist(), turn=1.5)
STD_PX = 0.1


def rig_with(views: BoardViews, **known: object) -> Rig:
    seen = Observations(board=views)
    return Rig(TRUTH.target, TRUTH.camera.image_size, observations=seen, **known)  # pyright: ignore[reportArgumentType]


def moved(points: np.ndarray, by: np.ndarray, about: np.ndarray) -> np.ndarray:
    """Points turned about a point by a rotation vector, and shifted."""
    return Rotation.from_rotvec(by[:3]).apply(points - about) + about + by[3:]


def camera_of(change: np.ndarray) -> Camera:
    c = TRUTH.camera
    alpha, beta, u0, v0 = np.array([c.alpha, c.beta, c.u0, c.v0]) + change
    return Camera(c.image_size, alpha, beta, u0, v0)


def slopes(of: Callable[[np.ndarray], np.ndarray], steps: np.ndarray) -> np.ndarray:
    """Derivatives by central differences, a column for each parameter."""
    moves = np.diag(steps)
    return np.stack([(of(h) - of(-h)) / (2 * s) for h, s in zip(moves, steps, strict=True)], axis=1)


def test_it_is_that_of_all_pictures_adjusted_together():
    """Fisher information of four numbers of the camera, five boards and the sheet's pose, all by
    differences of image points. Few boards, so that the plate has much to say of the camera."""
    rng = np.random.default_rng(3)
    R, t = board_poses(TRUTH, SHEET_OF_PAPER, 5, rng, laser=None)
    unlit = np.zeros((5, 1), dtype=bool)
    seen = observed_boards(TRUTH, SHEET_OF_PAPER, R, t, rng, line_points=2, lit=unlit)
    boards = rig_with(seen, board=SHEET_OF_PAPER, lasers=())
    plate = rig_with(stepped_plate_views(TRUTH, PLATE, rng))
    ends = segments_in_sheet(TRUTH, 150.0, 6, rng)
    uv = TRUTH.camera.project(ends)
    bounding = bounding_calibration(plate, STD_PX, STD_PX, camera=boards)
    stated = [one.std for one in lengths(bounding, uv, np.zeros(6))]

    bodies = [*placed_points(SHEET_OF_PAPER.points, R, t), PLATE.points(TRUTH).reshape(-1, 3)]
    middle, normal_0 = bodies[-1].mean(axis=0), TRUTH.light_plane.normal.copy()

    def pictures(x: np.ndarray) -> np.ndarray:
        parts = zip(bodies, x[4:].reshape(-1, 6), strict=True)
        points = [moved(body, by, body.mean(axis=0)) for body, by in parts]
        return camera_of(x[:4]).project(np.concatenate(points)).ravel()

    def measured(x: np.ndarray) -> np.ndarray:
        normal = Rotation.from_rotvec(x[-6:-3]).apply(normal_0)
        rays = camera_of(x[:4]).unproject(uv)
        on = rays * (normal @ (middle + x[-3:]) / (rays @ normal))[..., None]
        return np.linalg.norm(on[:, 1] - on[:, 0], axis=1)

    steps = np.concatenate([np.full(4, 1e-2), np.tile([1e-5] * 3 + [1e-2] * 3, 6)])
    J, by = slopes(pictures, steps) * steps, slopes(measured, steps) * steps  # of one size
    spread = by @ np.linalg.inv(J.T @ J / STD_PX**2) @ by.T
    assert stated == pytest.approx(np.sqrt(np.diag(spread)), rel=1e-4)


def test_further_pictures_of_the_camera_cannot_harm_and_an_exact_camera_is_the_limit():
    rng = np.random.default_rng(4)
    plate = rig_with(stepped_plate_views(TRUTH, PLATE, rng))
    uv = TRUTH.camera.project(segments_in_sheet(TRUTH, 60.0, 8, rng))
    unlit = np.zeros((16, 1), dtype=bool)
    R, t = board_poses(TRUTH, SHEET_OF_PAPER, 16, rng, laser=None)
    seen = observed_boards(TRUTH, SHEET_OF_PAPER, R, t, rng, line_points=2, lit=unlit)
    stds = []
    for count in (5, 8, 16):
        boards = rig_with(seen.take(np.arange(16) < count), board=SHEET_OF_PAPER, lasers=())
        bounding = bounding_calibration(plate, STD_PX, STD_PX, camera=boards)
        stds.append([one.std for one in lengths(bounding, uv, np.zeros(8))])
    exact = calibrate(replace(plate, pixel_std=STD_PX, camera=TRUTH.camera), "self-generated")
    stds.append([one.std for one in lengths(exact, uv, np.zeros(8))])
    assert (np.diff(stds, axis=0) < 0).all()
