"""A camera from its own moves: exact, with the uncertainty it states, and refused in words."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from sheetoflight.calibration.absolute_conic import (
    epipolar_distances,
    fundamental_matrix,
    kruppa_focal_lengths,
    kruppa_residuals,
)
from sheetoflight.calibration.moving_camera import moving_camera
from sheetoflight.calibration.track_start import triangulated
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.rotations import cross_matrix, rotation
from tests.calibration.tracks import BARREL, CAMERA, TWO_AXES, carried, moving, scene, turning

SIZE = (1400, 1000)


@settings(max_examples=4)
@given(st.integers(0, 1000))
def test_exact_tracks_give_the_exact_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations, translations = carried(5, rng)
    uv = moving(BARREL, rotations, translations, scene(45, rng))
    fit = moving_camera(uv, SIZE, "radial1")
    assert fit.pixels == "rectangular"
    assert np.allclose(fit.camera.parameters, BARREL.parameters, rtol=1e-8, atol=1e-8)
    assert np.allclose(fit.camera_from_first[..., :3], rotations, atol=1e-8)
    far = np.linalg.norm(translations, axis=1).max()
    assert np.allclose(fit.camera_from_first[..., 3], translations / far, atol=1e-8)


def test_the_stated_uncertainty_is_that_of_repeated_trials() -> None:
    """Normalised errors of 20 trials; they leave the interval by chance once in 1000."""
    total, trials = 0.0, 20
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        uv = moving(CAMERA, *carried(5, rng), scene(40, rng))
        uv += 0.2 * rng.normal(size=uv.shape)
        fit = moving_camera(uv, SIZE, pixels="rectangular", pixel_std=0.2)
        error = (fit.camera.parameters - CAMERA.parameters)[[0, 1, 3, 4]]
        total += float(error @ np.linalg.solve(fit.covariance, error))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], trials * 4)
    assert low < total < high


def test_the_residuals_tell_the_noise() -> None:
    """s² of 1000 degrees of freedom scatters by 4.5 %, four times that is 18 %."""
    rng = np.random.default_rng(3)
    uv = moving(CAMERA, *carried(6, rng), scene(120, rng))
    fit = moving_camera(uv + 0.25 * rng.normal(size=uv.shape), SIZE)
    assert fit.degrees_of_freedom > 1000
    assert fit.rms_px**2 == pytest.approx(0.25**2, rel=0.18)


def test_a_fundamental_matrix_is_exact_and_as_good_as_opencvs() -> None:
    rng = np.random.default_rng(4)
    rotations, translations = carried(2, rng)
    first, second = moving(CAMERA, rotations, translations, scene(80, rng))
    back = np.linalg.inv(CAMERA.matrix)
    expected = back.T @ cross_matrix(translations[1]) @ rotations[1] @ back
    exact = fundamental_matrix(first, second)
    assert exact is not None
    expected /= np.linalg.norm(expected)
    assert np.allclose(exact * np.sign(np.sum(exact * expected)), expected, atol=1e-12)

    both = np.isfinite(first + second).all(axis=1)
    x1, x2 = (x[both] + 0.3 * rng.normal(size=(int(both.sum()), 2)) for x in (first, second))
    ours, theirs = fundamental_matrix(x1, x2), cv2.findFundamentalMat(x1, x2, cv2.FM_8POINT)[0]
    assert ours is not None
    assert abs(np.linalg.det(ours / np.linalg.norm(ours))) < 1e-15
    least = np.sum(epipolar_distances(theirs, x1, x2) ** 2)
    assert np.sum(epipolar_distances(ours, x1, x2) ** 2) < 1.001 * least


def test_weights_gain_where_the_camera_moves_forwards() -> None:
    """Near the epipole the eight-point equations count for too little: on average their distances
    are some 8 % greater."""
    ours, theirs = 0.0, 0.0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        turn = rotation(0.05 * rng.normal(size=3))
        shift = np.array([20.0, 10.0, -500.0])
        uv = moving(
            CAMERA, np.stack([np.eye(3), turn]), np.stack([0 * shift, shift]), scene(100, rng)
        )
        seen = np.isfinite(uv[..., 0]).all(axis=0)
        x1, x2 = uv[:, seen] + 0.5 * rng.normal(size=uv[:, seen].shape)
        F = fundamental_matrix(x1, x2)
        assert F is not None
        ours += float(np.sum(epipolar_distances(F, x1, x2) ** 2))
        plain = cv2.findFundamentalMat(x1, x2, cv2.FM_8POINT)[0]
        theirs += float(np.sum(epipolar_distances(plain, x1, x2) ** 2))
    assert ours < 0.97 * theirs


def test_seven_matches_give_no_fundamental_matrix() -> None:
    x = np.random.default_rng(5).uniform(0, 1000, (2, 7, 2))
    assert fundamental_matrix(x[0], x[1]) is None


def fundamentals(K: np.ndarray, turns: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    back = np.linalg.inv(K)
    return back.T @ cross_matrix(shifts) @ rotation(turns) @ back


@given(st.integers(0, 10_000), st.floats(0.7, 6.0))
def test_the_true_conic_solves_kruppas_equations(seed: int, focal: float) -> None:
    rng = np.random.default_rng(seed)
    K = np.array([[focal, 0.1, 0.3], [0.0, 1.1 * focal, -0.2], [0.0, 0.0, 1.0]])
    F = fundamentals(K, 0.5 * rng.normal(size=(4, 3)), rng.normal(size=(4, 3)))
    conics = np.stack([K @ K.T, np.diag([focal**2, focal**2, 1.0])])
    right, wrong = kruppa_residuals(F, conics)
    assert np.abs(right).max() < 1e-9
    assert np.abs(wrong).max() > 1e-4


@given(st.integers(0, 10_000), st.floats(0.7, 6.0))
def test_kruppas_equations_give_the_focal_length(seed: int, focal: float) -> None:
    rng = np.random.default_rng(seed)
    K = np.diag([focal, focal, 1.0])
    turns = rng.uniform(0.2, 0.5, (6, 1)) * rng.normal(size=(6, 3))
    found = kruppa_focal_lengths(list(fundamentals(K, turns, rng.normal(size=(6, 3)))))
    assert found[0] == pytest.approx(focal, rel=1e-8)


def test_moves_without_turns_leave_kruppas_equations_open() -> None:
    shifts = np.random.default_rng(6).normal(size=(5, 3))
    F = fundamentals(np.diag([2.0, 2.0, 1.0]), np.zeros((5, 3)), shifts)
    assert kruppa_focal_lengths(list(F)) == []


def test_triangulated_points_are_exact_and_in_front() -> None:
    rng = np.random.default_rng(7)
    rotations, translations = carried(3, rng)
    points = scene(20, rng)
    poses = np.concatenate([rotations, translations[..., None]], axis=2)
    views = np.einsum("vij,tj->vti", rotations, points) + translations[:, None]
    xy = views[..., :2] / views[..., 2:]
    xy[2, :5] = np.nan
    xy[1, :2] = np.nan
    found = triangulated(poses, xy)
    assert np.isnan(found[:2]).all()
    assert np.allclose(found[2:], points[2:], atol=1e-8)
    behind = triangulated(poses * [1.0, 1.0, 1.0, -1.0], xy)
    assert np.isnan(behind).all()


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_moves_without_turns_are_refused(noise: float) -> None:
    rng = np.random.default_rng(8)
    _, translations = carried(5, rng)
    uv = moving(CAMERA, np.stack([np.eye(3)] * 5), 0.3 * translations, scene(60, rng))
    with pytest.raises(UntrustworthyError, match="moves without a turn leave the focal length"):
        moving_camera(uv + noise * rng.normal(size=uv.shape), SIZE)


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_turns_without_a_move_are_refused(noise: float) -> None:
    rng = np.random.default_rng(9)
    uv = turning(CAMERA, TWO_AXES, 150, rng)
    with pytest.raises(UntrustworthyError, match="no pair of views shows depth"):
        moving_camera(uv + noise * rng.normal(size=uv.shape), SIZE)


def test_a_flat_scene_is_refused() -> None:
    rng = np.random.default_rng(10)
    points = scene(60, rng) * [1.0, 1.0, 0.0] + [0.0, 0.0, 1000.0]
    uv = moving(CAMERA, *carried(4, rng), points) + 0.2 * rng.normal(size=(4, 60, 2))
    with pytest.raises(UntrustworthyError, match="or the scene is flat"):
        moving_camera(uv, SIZE)


def test_a_turntable_leaves_the_general_camera_open() -> None:
    rng = np.random.default_rng(11)
    rotations = rotation(np.outer(0.25 * np.arange(5), [0.0, 1.0, 0.0]))
    axis = np.array([0.0, 0.0, 1000.0])
    uv = moving(CAMERA, rotations, axis - rotations @ axis, scene(40, rng))
    with pytest.raises(UntrustworthyError, match="turns about one axis by up to some 5"):
        moving_camera(uv + 0.2 * rng.normal(size=uv.shape), SIZE, pixels="rectangular")


def test_a_view_apart_is_named() -> None:
    rng = np.random.default_rng(12)
    uv = moving(CAMERA, *carried(5, rng), scene(60, rng))
    uv[3] = np.nan
    with pytest.raises(UntrustworthyError, match="view 3 shares fewer than 10 points"):
        moving_camera(uv, SIZE)


def test_two_views_few_tracks_and_other_shapes_are_refused() -> None:
    rng = np.random.default_rng(13)
    uv = moving(CAMERA, *carried(5, rng), scene(60, rng))
    with pytest.raises(UntrustworthyError, match="at least 15 points through at least 3 views"):
        moving_camera(uv[:2], SIZE)
    with pytest.raises(UntrustworthyError, match="at least 15 points"):
        moving_camera(uv[:, :12], SIZE)
    with pytest.raises(InputError, match="shape"):
        moving_camera(uv[..., 0], SIZE)
    with pytest.raises(InputError, match="pixels is 'round'"):
        moving_camera(uv, SIZE, pixels="round")  # pyright: ignore[reportArgumentType]
