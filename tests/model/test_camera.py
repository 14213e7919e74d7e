"""The camera against OpenCV, its inverse, and finite differences."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.errors import InputError
from sheetoflight.model.camera import Camera

SIZE = (1392, 1040)


@st.composite
def cameras(draw: st.DrawFn, skew: bool = True) -> Camera:
    """Cameras whose distortion stays within its turning point over the picture."""
    alpha = draw(st.floats(900.0, 6000.0))
    return Camera(
        SIZE,
        alpha=alpha,
        beta=alpha * draw(st.floats(0.9, 1.1)),
        gamma=draw(st.floats(-20.0, 20.0)) if skew else 0.0,
        u0=draw(st.floats(600.0, 800.0)),
        v0=draw(st.floats(450.0, 600.0)),
        distortion=(
            draw(st.floats(-0.15, 0.15)),
            draw(st.floats(-0.02, 0.05)),
            draw(st.floats(-0.002, 0.002)),
            draw(st.floats(-0.002, 0.002)),
            draw(st.floats(-0.005, 0.005)),
        ),
    )


def points_seen(camera: Camera, seed: int, count: int = 50) -> np.ndarray:
    """Points in front of the camera whose image points lie about the picture."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform([0, 0], SIZE, (count, 2))
    y = (uv[:, 1] - camera.v0) / camera.beta
    x = (uv[:, 0] - camera.u0) / camera.alpha
    z = rng.uniform(300, 3000, count)
    return np.stack([x * z, y * z, z], axis=1)


@given(cameras(skew=False), st.integers(0, 100))
def test_projection_agrees_with_opencv(camera: Camera, seed: int) -> None:
    points = points_seen(camera, seed)
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    assert np.abs(camera.project(points) - expected[:, 0]).max() < 1e-9


@given(cameras(), st.integers(0, 100))
def test_projection_and_its_inverse_cancel(camera: Camera, seed: int) -> None:
    points = points_seen(camera, seed)
    rays = camera.unproject(camera.project(points))
    assert np.abs(camera.project(rays) - camera.project(points)).max() < 1e-8
    assert np.abs(rays * points[:, 2:] - points).max() < 1e-6


@given(cameras(), st.integers(0, 100))
def test_jacobians_agree_with_differences(camera: Camera, seed: int) -> None:
    points = points_seen(camera, seed, 5)
    uv, by_point, by_parameter = camera.project_with_jacobians(points)
    assert np.abs(uv - camera.project(points)).max() < 1e-11  # a hundred roundings of 1000 px
    for axis, step in enumerate(np.eye(3) * 1e-2):
        slope = (camera.project(points + step) - camera.project(points - step)) / 2e-2
        assert np.allclose(by_point[..., axis], slope, rtol=1e-6, atol=1e-6)
    for index in range(10):
        h = 1e-5
        step = h * np.eye(10)[index]
        above = camera.with_parameters(camera.parameters + step).project(points)
        below = camera.with_parameters(camera.parameters - step).project(points)
        slope = (above - below) / (2 * h)
        assert np.allclose(by_parameter[..., index], slope, rtol=1e-5, atol=1e-5)


@given(cameras(), st.sets(st.integers(0, 9)).map(sorted))
def test_chosen_parameters_are_columns_of_all(camera: Camera, chosen: list[int]) -> None:
    points = points_seen(camera, 1)
    _, _, everything = camera.project_with_jacobians(points)
    _, _, some = camera.project_with_jacobians(points, chosen)
    assert np.array_equal(some, everything[..., chosen])


@given(cameras(), st.integers(0, 100))
def test_ray_jacobians_agree_with_differences(camera: Camera, seed: int) -> None:
    uv = camera.project(points_seen(camera, seed, 5))
    rays, by_pixel, by_parameter = camera.unproject_with_jacobians(uv)
    assert np.array_equal(rays, camera.unproject(uv))
    for axis, step in enumerate(np.eye(2) * 0.1):
        slope = (camera.unproject(uv + step) - camera.unproject(uv - step)) / 0.2
        assert np.allclose(by_pixel[..., axis], slope[..., :2], rtol=1e-5, atol=1e-9)
    for index in range(10):
        h = 1e-3 if index < 5 else 1e-6
        step = h * np.eye(10)[index]
        above = camera.with_parameters(camera.parameters + step).unproject(uv)
        below = camera.with_parameters(camera.parameters - step).unproject(uv)
        slope = (above - below)[..., :2] / (2 * h)
        assert np.allclose(by_parameter[..., index], slope, rtol=1e-4, atol=1e-8)


def test_points_behind_the_camera_have_no_image() -> None:
    camera = Camera(SIZE, 2000.0, 2000.0, 695.5, 519.5)
    assert np.isnan(camera.project(np.array([[1.0, 2.0, -5.0], [1.0, 2.0, 0.0]]))).all()


def test_pixels_beyond_the_turning_point_have_no_ray() -> None:
    # r (1 + k1 r²) turns at r = sqrt(-1 / (3 k1)); no ray reaches a distorted radius beyond
    camera = Camera(SIZE, 500.0, 500.0, 695.5, 519.5, distortion=(-0.35, 0.0, 0.0, 0.0, 0.0))
    turning = np.sqrt(1 / (3 * 0.35))
    reach = 500.0 * turning * (1 - 0.35 * turning**2)
    uv = np.array([[695.5 + 0.999 * reach, 519.5], [695.5 + 1.001 * reach, 519.5]])
    rays = camera.unproject(uv)
    assert np.isfinite(rays[0]).all()
    assert rays[0, 0] < turning
    assert np.isnan(rays[1, :2]).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"alpha": -1.0}, "focal"),
        ({"beta": np.nan}, "finite"),
        ({"distortion": (0.0, 0.0)}, "coefficients"),
        ({"image_size": (0, 10)}, "image_size"),
    ],
    ids=["negative", "nan", "few", "size"],
)
def test_an_impossible_camera_is_refused(change: dict[str, object], said: str) -> None:
    values: dict[str, object] = {
        "image_size": SIZE, "alpha": 1000.0, "beta": 1000.0, "u0": 1.0, "v0": 1.0,
    }  # fmt: skip
    with pytest.raises(InputError, match=said):
        Camera(**{**values, **change})  # pyright: ignore[reportArgumentType]


def test_a_matrix_makes_the_camera_it_came_from() -> None:
    camera = Camera(SIZE, 2000.0, 1990.0, 695.5, 519.5, 0.3, (0.1, 0.0, 0.001, 0.0, 0.0))
    assert Camera.from_matrix(SIZE, camera.matrix, camera.distortion) == camera
    with pytest.raises(InputError, match="camera matrix"):
        Camera.from_matrix(SIZE, np.ones((3, 3)))
