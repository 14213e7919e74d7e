"""A camera from its own turns: exact, with the uncertainty it states, and refused in words."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from sheetoflight.calibration.rotating_camera import conic_cameras, rotating_camera
from sheetoflight.calibration.self_calibration import Pixels, turns
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera
from tests.calibration.tracks import BARREL, CAMERA, TWO_AXES, turning

SIZE = (1400, 1000)
LINE_OF_SIGHT = [[0, 0, a] for a in (0.0, 0.15, -0.15, 0.3, -0.3)]


@settings(max_examples=6)
@given(st.integers(0, 10_000))
def test_exact_tracks_give_the_exact_camera(seed: int) -> None:
    uv = turning(BARREL, TWO_AXES, 80, np.random.default_rng(seed))
    fit = rotating_camera(uv, SIZE, "radial1")
    assert fit.converged
    assert np.allclose(fit.camera.parameters, BARREL.parameters, rtol=1e-9, atol=1e-9)
    assert np.allclose(fit.camera_from_first[..., :3], rotation(np.array(TWO_AXES)), atol=1e-9)
    assert not fit.camera_from_first[..., 3].any()


@pytest.mark.parametrize("pixels", ["skewed", "rectangular", "square", "centred"])
def test_the_linear_equations_are_exact_for_every_model(pixels: Pixels) -> None:
    K = {
        "skewed": np.array([[2.1, 0.1, 0.2], [0, 1.9, -0.1], [0, 0, 1]]),
        "rectangular": np.array([[2.1, 0, 0.2], [0, 1.9, -0.1], [0, 0, 1]]),
        "square": np.array([[2.0, 0, 0.2], [0, 2.0, -0.1], [0, 0, 1]]),
        "centred": np.diag([2.0, 2.0, 1.0]),
    }[pixels]
    maps = -3.0 * K @ rotation(np.array(TWO_AXES[1:4])) @ np.linalg.inv(K)
    assert np.allclose(conic_cameras(maps)[pixels], K, atol=1e-10)


def test_one_axis_leaves_the_general_camera_open_and_gives_a_reduced_one() -> None:
    K = np.array([[2.0, 0, 0.2], [0, 2.0, -0.1], [0, 0, 1]])
    axis = np.array([0.1, 1.0, 0.0])
    maps = K @ rotation(np.outer([0.2, 0.3, -0.2], axis)) @ np.linalg.inv(K)
    found = conic_cameras(maps)
    assert "skewed" not in found
    assert np.allclose(found["square"], K, atol=1e-8)


def test_the_stated_uncertainty_is_that_of_repeated_trials() -> None:
    """Normalised errors of 40 trials; they leave the interval by chance once in 5000."""
    total, trials = 0.0, 40
    places = [0, 1, 3, 4, 5]
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        uv = turning(BARREL, TWO_AXES, 60, rng)
        uv += 0.3 * rng.normal(size=uv.shape)
        fit = rotating_camera(uv, SIZE, "radial1", "rectangular", pixel_std=0.3)
        error = (fit.camera.parameters - BARREL.parameters)[places]
        total += float(error @ np.linalg.solve(fit.covariance, error))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], trials * len(places))
    assert low < total < high


def test_the_residuals_tell_the_noise() -> None:
    """s² of 1900 degrees of freedom scatters by 3 %, four times that is 13 %."""
    rng = np.random.default_rng(2)
    uv = turning(CAMERA, TWO_AXES, 420, rng)
    fit = rotating_camera(uv + 0.25 * rng.normal(size=uv.shape), SIZE)
    assert fit.degrees_of_freedom > 1900
    assert fit.rms_px**2 == pytest.approx(0.25**2, rel=0.13)
    assert fit.pixels == "rectangular"
    assert fit.names == ("camera.alpha", "camera.beta", "camera.u0", "camera.v0")


def test_square_pixels_have_one_focal_length() -> None:
    rng = np.random.default_rng(3)
    square = Camera(SIZE, 1500.0, 1500.0, 720.0, 480.0)
    uv = turning(square, TWO_AXES, 60, rng)
    fit = rotating_camera(uv + 0.2 * rng.normal(size=uv.shape), SIZE, pixels="square")
    assert fit.camera.alpha == fit.camera.beta
    assert fit.covariance[0, 0] == pytest.approx(fit.covariance[0, 1])
    assert abs(fit.camera.alpha - 1500.0) < 5.0 * fit.std("camera.alpha")


def test_turns_that_hardly_tell_give_the_simpler_camera() -> None:
    rng = np.random.default_rng(4)
    camera = Camera(SIZE, 1500.0, 1500.0, 699.5, 499.5)
    uv = turning(camera, [[0, a, 0] for a in (0.0, 0.06, -0.06)], 80, rng)
    fit = rotating_camera(uv + 0.5 * rng.normal(size=uv.shape), SIZE)
    assert fit.pixels in ("square", "centred")
    assert abs(fit.camera.alpha - 1500.0) < 5.0 * fit.std("camera.alpha")


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_turns_about_the_line_of_sight_are_refused(noise: float) -> None:
    rng = np.random.default_rng(5)
    uv = turning(CAMERA, LINE_OF_SIGHT, 40, rng)
    with pytest.raises(UntrustworthyError, match="about the line of sight alone, by up to 17"):
        rotating_camera(uv + noise * rng.normal(size=uv.shape), SIZE)


def test_slight_turns_are_refused() -> None:
    rng = np.random.default_rng(6)
    uv = turning(CAMERA, [[0.002 * t for t in turn] for turn in TWO_AXES], 40, rng)
    with pytest.raises(UntrustworthyError, match="leave the focal length or the principal point"):
        rotating_camera(uv + 0.2 * rng.normal(size=uv.shape), SIZE)


def test_a_view_apart_is_named() -> None:
    uv = turning(CAMERA, TWO_AXES, 80, np.random.default_rng(7))
    uv[4, :, :] = np.nan
    with pytest.raises(UntrustworthyError, match="view 4 shares fewer than 5 points"):
        rotating_camera(uv, SIZE)


def test_few_tracks_and_other_shapes_are_refused() -> None:
    uv = turning(CAMERA, TWO_AXES, 80, np.random.default_rng(8))
    with pytest.raises(UntrustworthyError, match="follow at least 8 points"):
        rotating_camera(uv[:, :5], SIZE)
    with pytest.raises(InputError, match="shape"):
        rotating_camera(uv[0], SIZE)
    with pytest.raises(InputError, match="distortion is 'fisheye'"):
        rotating_camera(uv, SIZE, "fisheye")


def test_rotation_vectors_are_opencvs() -> None:
    vectors = np.random.default_rng(9).normal(size=(20, 3))
    matrices = rotation(vectors)
    expected = np.array([cv2.Rodrigues(R)[0][:, 0] for R in matrices])
    assert np.allclose(turns(matrices), expected, atol=1e-12)
    assert np.array_equal(turns(np.eye(3)[None]), np.zeros((1, 3)))
