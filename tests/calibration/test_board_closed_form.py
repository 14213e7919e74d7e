"""Homographies and poses of flat boards: exact on exact data, and held against OpenCV."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from sheetoflight.calibration.board_closed_form import (
    homographies,
    other_pose,
    pose_from_homography,
)
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.board import PlanarBoard

BOARD = PlanarBoard("chessboard", 9, 7, (12.0, 14.0)).points
K = np.array([[1500.0, 0.7, 690.0], [0.0, 1480.0, 510.0], [0.0, 0.0, 1.0]])


def poses(count: int, rng: np.random.Generator, tilt: float = 0.35) -> tuple[Any, Any]:
    rotations = np.array([rotation(tilt * rng.normal(size=3)) for _ in range(count)])
    middle = np.c_[rng.uniform(-80, 80, (count, 2)), rng.uniform(400, 700, count)]
    return rotations, middle - rotations @ BOARD.mean(axis=0)


def seen_from(rotations: np.ndarray, translations: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    rays = (BOARD @ np.swapaxes(rotations, 1, 2) + translations[:, None]) @ matrix.T
    return rays[..., :2] / rays[..., 2:]


def mapped(H: np.ndarray) -> np.ndarray:
    image = np.c_[BOARD[:, :2], np.ones(len(BOARD))] @ H.T
    return image[:, :2] / image[:, 2:]


@given(st.integers(0, 10_000), st.floats(0.0, 0.6))
def test_exact_images_give_the_exact_poses(seed: int, hidden: float) -> None:
    rng = np.random.default_rng(seed)
    rotations, translations = poses(6, rng)
    uv = seen_from(rotations, translations, K)
    gone = rng.random(uv.shape[:2]) < hidden
    gone[:, [0, 8, 54, 62]] = False
    uv[gone] = np.nan
    R, t = pose_from_homography(K, homographies(BOARD, uv))
    assert np.allclose(R, rotations, atol=1e-9)
    assert np.allclose(t, translations, atol=1e-7)


def test_a_hidden_point_in_one_view_leaves_the_others_alone() -> None:
    uv = seen_from(*poses(3, np.random.default_rng(1)), K)
    uv += np.random.default_rng(2).normal(size=uv.shape)
    hidden = uv.copy()
    hidden[1, 5] = np.nan
    whole, part = homographies(BOARD, uv), homographies(BOARD, hidden)
    assert np.allclose(whole[[0, 2]], part[[0, 2]], rtol=1e-12, atol=1e-15)
    assert np.abs(whole[1] - part[1]).max() > 1e-9


def test_noise_costs_no_more_than_in_the_best_homography() -> None:
    """OpenCV minimises the distances themselves: no homography can be nearer to the points."""
    rotations, translations = poses(6, np.random.default_rng(3))
    rotations[:3] = rotation(np.array([[1.1, 0, 0], [0.8, 0.8, 0], [0, -1.1, 0]]))
    middle = np.array([0.0, 0.0, 115.0])  # near and steep: depths differ by a factor of three
    translations[:3] = middle - rotations[:3] @ BOARD.mean(axis=0)
    uv = seen_from(rotations, translations, K)
    uv += 0.5 * np.random.default_rng(4).normal(size=uv.shape)
    for H, image in zip(homographies(BOARD, uv), uv, strict=True):
        best = cv2.findHomography(BOARD[:, :2], image, 0)[0]
        least = np.sum((mapped(best) - image) ** 2)
        assert np.sum((mapped(H) - image) ** 2) < 1.001 * least


def test_homographies_do_not_depend_on_units() -> None:
    uv = seen_from(*poses(4, np.random.default_rng(5)), K)
    uv += np.random.default_rng(6).normal(size=uv.shape)
    scale = np.diag([1e-3, 1e-3, 1.0])
    shrunk = homographies(1e3 * BOARD, uv) @ np.linalg.inv(scale)
    H = homographies(BOARD, uv)
    for one, other in zip(H, shrunk, strict=True):
        assert np.allclose(other / other[2, 2], one / one[2, 2], rtol=1e-8)


@pytest.mark.parametrize(
    "places",
    [[0, 1, 9], [0, 1, 2, 3, 4], [0, 4, 8, 40], [0, 1, 2, 3, 4, 5, 6, 62]],
    ids=["three", "a row", "three of four on a line", "all but one on a line"],
)
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_too_little_gives_no_homography(places: list[int], noise: float) -> None:
    uv = seen_from(*poses(2, np.random.default_rng(7)), K)
    uv += noise * np.random.default_rng(8).normal(size=uv.shape)
    few = np.full_like(uv, np.nan)
    few[0], few[1, places] = uv[0], uv[1, places]
    H = homographies(BOARD, few)
    assert np.isfinite(H[0]).all()
    assert np.isnan(H[1]).all()
    R, t = pose_from_homography(K, H)
    assert np.isfinite(R[0]).all()
    assert np.isnan(R[1]).all()
    assert np.isnan(t[1]).all()


def test_rotations_from_noisy_homographies_are_the_nearest() -> None:
    uv = seen_from(*poses(4, np.random.default_rng(8)), K)
    H = homographies(BOARD, uv + np.random.default_rng(9).normal(size=uv.shape))
    rotations, translations = pose_from_homography(K, H)
    assert np.allclose(rotations @ np.swapaxes(rotations, 1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(rotations), 1.0)
    for R, t, map_ in zip(rotations, translations, np.linalg.inv(K) @ H, strict=True):
        scale = np.sum(map_[:, :2] * R[:, :2]) / 2.0  # least squares of the two columns
        assert np.allclose(scale * t, map_[:, 2], rtol=1e-12)

        def distance(turn: np.ndarray, R=R, columns=map_[:, :2] / scale) -> float:
            return float(np.sum(((rotation(turn) @ R)[:, :2] - columns) ** 2))

        here = distance(np.zeros(3))
        for axis in np.eye(3):
            for step in (-1e-3, 1e-3):
                assert distance(step * axis) > here


def ippe(xy: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """OpenCV's two poses, the better one first."""
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        BOARD, xy, np.eye(3), np.zeros(0), flags=cv2.SOLVEPNP_IPPE
    )
    return [(cv2.Rodrigues(r)[0], t[:, 0]) for r, t in zip(turns, shifts, strict=True)]


def settled(xy: np.ndarray, R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, float]:
    """The rotation at the minimum of the image error near a pose, and the error there."""

    def residuals(step: np.ndarray) -> np.ndarray:
        points = BOARD @ (rotation(step[:3]) @ R).T + t + step[3:]
        return 1e3 * (points[:, :2] / points[:, 2:] - xy).ravel()

    fit = least_squares(
        residuals, np.zeros(6), xtol=1e-14, ftol=1e-14, x_scale=[1, 1, 1, 1e3, 1e3, 1e3]
    )
    return rotation(fit.x[:3]) @ R, fit.cost


@pytest.mark.parametrize("seed", range(6))
def test_the_other_pose_leads_to_the_second_minimum(seed: int) -> None:
    """The minima that begin from OpenCV's two poses are those from a pose and its other one."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(0, 2 * np.pi)
    turn = rng.uniform(0.3, 0.9) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    rotations = rotation(turn)[None]
    translations = np.array([[0.0, 0.0, 1500.0]]) - rotations @ BOARD.mean(axis=0)
    xy = seen_from(rotations, translations, np.eye(3))
    xy += 2e-4 * rng.normal(size=xy.shape)
    R, t = other_pose(xy, BOARD, rotations, translations)
    oracle = [settled(xy[0], *pose) for pose in ippe(xy[0])]
    true = settled(xy[0], rotations[0], translations[0])
    other = settled(xy[0], R[0], t[0])
    for ours in (true, other):
        apart = [np.linalg.norm(ours[0] - theirs[0]) for theirs in oracle]
        assert min(apart) < 1e-4
        assert ours[1] == pytest.approx(oracle[int(np.argmin(apart))][1], rel=1e-6)
    assert np.linalg.norm(true[0] - other[0]) > 0.05


def test_the_other_of_the_other_pose_is_the_first() -> None:
    rotations, translations = poses(5, np.random.default_rng(12))
    xy = seen_from(rotations, translations, np.eye(3))
    xy[2, :20] = np.nan
    R, t = other_pose(xy, BOARD, rotations, translations)
    assert np.allclose(np.linalg.det(R), 1.0)
    seen = np.asarray(np.isfinite(xy).all(axis=-1))
    aside = np.array([BOARD[s].mean(axis=0) for s in seen])
    sight = np.einsum("nij,nj->ni", rotations, aside) + translations
    assert np.allclose(
        other_pose(xy, BOARD, R, sight - np.einsum("nij,nj->ni", R, aside))[0], rotations
    )
    assert (np.linalg.norm(t - translations, axis=1) > 0).all()


def test_a_board_that_faces_the_camera_has_one_pose() -> None:
    translations = np.array([[-48.0, -42.0, 500.0]])
    xy = seen_from(np.eye(3)[None], translations, np.eye(3))
    R, t = other_pose(xy, BOARD, np.eye(3)[None], translations)
    assert np.allclose(R, np.eye(3), atol=1e-12)
    assert np.allclose(t, translations)


def test_two_points_give_no_other_pose() -> None:
    rotations, translations = poses(1, np.random.default_rng(13))
    xy = seen_from(rotations, translations, np.eye(3))
    xy[0, 2:] = np.nan
    assert np.isnan(other_pose(xy, BOARD, rotations, translations)[1]).all()
