"""Cameras from one view of known points: exact on exact data, none from degenerate points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.calibration.radial_alignment import tsai_camera
from sheetoflight.calibration.solid_closed_form import dlt_camera, solid_pose
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera

SIZE = (1400, 1000)
SKEWED = Camera(SIZE, 1500.0, 1480.0, 690.0, 510.0, gamma=0.8)
BARREL = Camera(SIZE, 1510.0, 1480.0, 690.0, 510.0, distortion=(-0.22, 0.0, 0.0, 0.0, 0.0))
CENTRE = np.array([690.0, 510.0])
ASPECT = 1510.0 / 1480.0


def body(count: int, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-90, 90, (count, 3)) + np.array([300.0, 0.0, -200.0])


def pose(rng: np.random.Generator) -> np.ndarray:
    R = rotation(rng.uniform(0.3, 2.5) * rng.normal(size=3))
    middle = [*rng.uniform(-60, 60, 2), rng.uniform(400, 600)]
    return np.column_stack([R, middle - R @ [300.0, 0.0, -200.0]])


def placed(points: np.ndarray, camera_from_target: np.ndarray) -> np.ndarray:
    return points @ camera_from_target[:, :3].T + camera_from_target[:, 3]


@given(st.integers(0, 10_000), st.integers(6, 30))
def test_a_solid_body_gives_the_camera_exactly(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points, truth = body(count, rng), pose(rng)
    uv = SKEWED.project(placed(points, truth))
    found = dlt_camera(np.r_[points, [[0.0, 0, 0]]], np.r_[uv, [[np.nan, np.nan]]])
    if found is None:  # six points may by chance be nearly degenerate
        assert count < 8
        return
    assert np.allclose(found[0], SKEWED.matrix, rtol=1e-6, atol=1e-3)
    assert np.allclose(found[1], truth, rtol=1e-6, atol=1e-3)


def test_a_good_body_gives_the_camera_to_rounding() -> None:
    rng = np.random.default_rng(5)
    points, truth = body(40, rng), pose(rng)
    found = dlt_camera(points, SKEWED.project(placed(points, truth)))
    assert found is not None
    assert np.allclose(found[0], SKEWED.matrix, rtol=1e-9, atol=1e-9 * 1500)
    assert np.allclose(found[1], truth, rtol=1e-9, atol=1e-8)


def test_the_matrix_is_taken_apart_as_opencv_does() -> None:
    rng = np.random.default_rng(6)
    points = body(25, rng)
    uv = SKEWED.project(placed(points, pose(rng))) + rng.normal(size=(25, 2))
    found = dlt_camera(points, uv)
    assert found is not None
    K, R, centre = cv2.decomposeProjectionMatrix(found[0] @ found[1])[:3]
    assert np.allclose(found[0], K / K[2, 2])
    assert np.allclose(found[1][:, :3], R)
    assert np.allclose(found[1] @ (centre / centre[3])[:, 0], 0.0, atol=1e-6)


def cubic(parameters: np.ndarray) -> np.ndarray:
    t = parameters[..., None]
    return 100.0 * np.concatenate([t, t**2, t**3], axis=-1)


def looking(points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Image of points from an eye that looks at their middle."""
    z = points.mean(axis=0) - eye
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.3], z)
    R = np.stack([x / np.linalg.norm(x), np.cross(z, x / np.linalg.norm(x)), z])
    return SKEWED.project(np.asarray((points - eye) @ R.T, dtype=float))


def degenerate(kind: str) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    if kind == "too few":
        points = body(5, rng)
        return points, SKEWED.project(placed(points, pose(rng)))
    if kind == "in a plane":
        points = np.c_[rng.uniform(-90, 90, (30, 2)), np.zeros(30)] @ rotation(np.ones(3)).T
        return points, looking(points, points.mean(axis=0) + np.array([10.0, 20.0, 600.0]))
    if kind == "twisted cubic":
        points = cubic(np.linspace(-1, 1, 20))
        return points, looking(points, cubic(np.array(2.4)))
    eye = np.array([50.0, 90.0, 500.0])
    plane = np.c_[rng.uniform(-90, 90, (20, 2)), np.zeros(20)]
    line = eye * (1.0 - np.array([0.6, 0.7, 0.8, 1.15]))[:, None]
    points = np.concatenate([plane, line])
    return points, looking(points, eye)


@pytest.mark.parametrize("kind", ["too few", "in a plane", "twisted cubic", "plane and line"])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_degenerate_points_give_no_camera(kind: str, noise: float) -> None:
    points, uv = degenerate(kind)
    assert np.isfinite(uv).all()
    uv = uv + noise * np.random.default_rng(8).normal(size=uv.shape)
    assert dlt_camera(points, uv) is None
    assert solid_pose(points, (uv - CENTRE) / 1500.0) is None


def test_a_body_in_a_left_handed_frame_is_refused() -> None:
    rng = np.random.default_rng(9)
    points = body(20, rng)
    uv = SKEWED.project(placed(points, pose(rng)))
    assert dlt_camera(points, uv) is not None
    assert dlt_camera(points * [1.0, 1.0, -1.0], uv) is None


@given(st.integers(0, 10_000))
def test_a_known_camera_gives_the_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, truth = body(12, rng), pose(rng)
    xy = BARREL.unproject(BARREL.project(placed(points, truth)))[:, :2]
    xy[3] = np.nan
    found = solid_pose(points, xy)
    assert found is not None
    assert np.allclose(found, truth, atol=1e-4)


def test_the_pose_of_noisy_points_is_near_the_best_one() -> None:
    rng = np.random.default_rng(10)
    points, truth = body(30, rng), pose(rng)
    xy = placed(points, truth)[:, :2] / placed(points, truth)[:, 2:]
    xy += 2e-4 * rng.normal(size=xy.shape)
    found = solid_pose(points, xy)
    assert found is not None
    _, turn, shift = cv2.solvePnP(points, xy, np.eye(3), np.zeros(0))
    assert np.allclose(found[:, :3], cv2.Rodrigues(turn)[0], atol=5e-3)
    assert np.allclose(
        placed(points, found), placed(points, np.c_[cv2.Rodrigues(turn)[0], shift]), atol=5.0
    )


@given(st.integers(0, 10_000), st.sampled_from([-0.3, -0.1, 0.0, 0.2]))
def test_alignment_gives_camera_and_distortion_exactly(seed: int, k1: float) -> None:
    rng = np.random.default_rng(seed)
    camera = Camera(SIZE, 1510.0, 1480.0, 690.0, 510.0, distortion=(k1, 0.0, 0.0, 0.0, 0.0))
    points, truth = body(25, rng), pose(rng)
    found = tsai_camera(points, camera.project(placed(points, truth)), CENTRE)
    assert found is not None
    assert (found.alpha, found.beta) == pytest.approx((1510.0, 1480.0), rel=1e-9)
    assert found.k1 == pytest.approx(k1, abs=1e-9)
    assert np.allclose(found.camera_from_target, truth, atol=1e-7)


@given(st.integers(0, 10_000), st.sampled_from([-0.3, 0.0, 0.2]))
def test_alignment_works_on_a_tilted_board(seed: int, k1: float) -> None:
    rng = np.random.default_rng(seed)
    camera = Camera(SIZE, 1510.0, 1480.0, 690.0, 510.0, distortion=(k1, 0.0, 0.0, 0.0, 0.0))
    azimuth = rng.uniform(0, 2 * np.pi)
    tilt = rotation(rng.uniform(0.3, 0.9) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    R = tilt @ rotation(np.array([0.0, 0.0, rng.uniform(0, 6)]))
    truth = np.column_stack([R, [*rng.uniform(-40, 40, 2), 500.0]])
    own = rotation(rng.normal(size=3))  # the board need not lie in z = 0 of its own frame
    points = np.c_[rng.uniform(-90, 90, (25, 2)), np.zeros(25)]
    found = tsai_camera(points @ own.T, camera.project(placed(points, truth)), CENTRE, ASPECT)
    assert found is not None
    assert (found.alpha, found.beta) == pytest.approx((1510.0, 1480.0), rel=1e-8)
    assert found.k1 == pytest.approx(k1, abs=1e-8)
    assert np.allclose(
        placed(points @ own.T, found.camera_from_target), placed(points, truth), atol=1e-5
    )


def test_alignment_is_near_the_best_fit_of_noisy_points() -> None:
    """OpenCV's fit of the same parameters; the first stage uses one coordinate of two, so it is
    less sure, by a factor of about two: five times OpenCV's own std is far outside."""
    rng = np.random.default_rng(11)
    points, truth = body(200, rng), pose(rng)
    uv = BARREL.project(placed(points, truth)) + 0.1 * rng.normal(size=(200, 2))
    found = tsai_camera(points, uv, CENTRE)
    assert found is not None
    flags = (
        cv2.CALIB_USE_INTRINSIC_GUESS
        | cv2.CALIB_FIX_PRINCIPAL_POINT
        | cv2.CALIB_ZERO_TANGENT_DIST
        | cv2.CALIB_FIX_K2
        | cv2.CALIB_FIX_K3
    )
    best = cv2.calibrateCameraExtended(
        [points.astype(np.float32)],
        [uv.astype(np.float32)],
        SIZE,
        BARREL.matrix.copy(),
        np.zeros(5),
        flags=flags,
    )
    matrix, distortion, stds = best[1], best[2].ravel(), best[5].ravel()
    assert abs(found.alpha - matrix[0, 0]) < 5.0 * stds[0]
    assert abs(found.beta - matrix[1, 1]) < 5.0 * stds[1]
    assert abs(found.k1 - distortion[0]) < 5.0 * stds[4]


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_board_that_faces_the_camera_gives_no_focal_length(noise: float) -> None:
    rng = np.random.default_rng(12)
    points = np.c_[rng.uniform(-90, 90, (40, 2)), np.zeros(40)]
    truth = np.column_stack([rotation(np.array([0.0, 0.0, 0.4])), [5.0, 8.0, 500.0]])
    plain = Camera(SIZE, 1500.0, 1500.0, 690.0, 510.0)
    uv = plain.project(placed(points, truth)) + noise * rng.normal(size=(40, 2))
    assert tsai_camera(points, uv, CENTRE) is None


@pytest.mark.parametrize("count", [4, 5, 6])
def test_too_few_points_in_space_give_nothing(count: int) -> None:
    rng = np.random.default_rng(13)
    points = body(count, rng)
    assert tsai_camera(points, BARREL.project(placed(points, pose(rng))), CENTRE) is None


def test_a_target_whose_middle_lies_on_the_axis_is_no_exception() -> None:
    """Tsai divides by Ty; here it is zero."""
    rng = np.random.default_rng(14)
    points = rng.uniform(-90, 90, (20, 3))
    points -= points.mean(axis=0)
    truth = np.column_stack([rotation(np.array([0.4, 0.3, 0.2])), [0.0, 0.0, 500.0]])
    found = tsai_camera(points, BARREL.project(placed(points, truth)), CENTRE)
    assert found is not None
    assert np.allclose(found.camera_from_target, truth, atol=1e-8)
