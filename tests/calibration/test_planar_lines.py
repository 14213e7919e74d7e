"""Sheets from lines on boards: through the points, and through the vanishing points."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.calibration.control_points import image_lines
from sheetoflight.calibration.planar_lines import (
    planes_of_boards,
    points_on_planes,
    sheet_by_points,
    sheet_by_vanishing_points,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.rotations import rotation
from tests.calibration.sheets import (
    NORMAL,
    assert_exact,
    assert_noise_averages,
    light_on,
    pose,
    project,
)

BOTH = pytest.mark.parametrize("method", [sheet_by_points, sheet_by_vanishing_points])


def seen(poses: np.ndarray, count: int = 20):
    """Image points, views and true points of the lines of light on boards."""
    planes = planes_of_boards(poses)
    points = np.concatenate(
        [
            light_on(plane[:3], plane[3], place[:, 3], 60.0, count)
            for plane, place in zip(planes, poses, strict=True)
        ]
    )
    return project(points), np.repeat(np.arange(len(poses)), count), planes, points


def poses(count: int, seed: int) -> np.ndarray:
    """Boards tilted to and fro about x, so that no two neighbouring lines are parallel."""
    rng = np.random.default_rng(seed)
    place = np.array([pose(rng, 0.1) for _ in range(count)])
    tilt = rotation(np.array([[0.35 * (-1) ** i, 0.0, 0.0] for i in range(count)]))
    place[:, :, :3] = tilt @ place[:, :, :3]
    return place


def shifted(offsets: list[list[float]]) -> np.ndarray:
    """Boards that were moved, not turned."""
    one = pose(np.random.default_rng(3))
    moved = np.repeat(one[None], len(offsets), axis=0)
    moved[:, :, 3] += np.array(offsets)
    return moved


@BOTH
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [2, 5])
def test_exact_lines_give_the_exact_sheet(method, seed: int, count: int) -> None:
    xy, view, planes, points = seen(poses(count, seed))
    found = method(xy, view, planes)
    assert_exact(found)
    assert np.allclose(found.points, points, rtol=0, atol=1e-9 * 520)


def test_a_boards_plane_holds_its_points() -> None:
    place = poses(4, 5)
    board = np.c_[np.random.default_rng(6).uniform(-90, 90, (9, 2)), np.zeros(9)]
    for plane, one in zip(planes_of_boards(place), place, strict=True):
        points = board @ one[:, :3].T + one[:, 3]
        assert np.allclose(points @ plane[:3], plane[3], rtol=0, atol=1e-9)
        assert np.linalg.norm(plane[:3]) == pytest.approx(1.0, abs=1e-12)


@BOTH
def test_the_order_of_views_and_unseen_points_do_not_matter(method) -> None:
    xy, view, planes, _ = seen(poses(5, 1))
    xy = xy + 1e-4 * np.random.default_rng(2).normal(size=xy.shape)
    turn = np.array([3, 0, 4, 1, 2])
    place = np.argsort(turn)
    one, other = method(xy, view, planes), method(xy, place[view], planes[turn])
    assert np.allclose(one.normal, other.normal, rtol=0, atol=1e-12)
    more = method(np.r_[xy, [[np.nan, np.nan]]], np.r_[view, 0], planes)
    assert np.allclose(one.normal, more.normal, rtol=0, atol=1e-12)
    assert np.isnan(more.points[-1]).all()


@BOTH
def test_noise_averages_out(method) -> None:
    xy, view, planes, _ = seen(poses(4, 11), 10)

    def measured(repeats: int, rng: np.random.Generator):
        many = np.tile(xy, (repeats, 1))
        noise = 2e-5 * rng.normal(size=many.shape)
        return method(many + noise, np.tile(view, repeats), planes)

    assert_noise_averages(measured)


def test_shifted_boards_give_the_sheet_by_points_alone() -> None:
    xy, view, planes, _ = seen(shifted([[0, 0, 0], [0, 0, 60], [5, 0, 120]]))
    assert_exact(sheet_by_points(xy, view, planes))
    with pytest.raises(UntrustworthyError, match="parallel in space"):
        sheet_by_vanishing_points(xy, view, planes)


@BOTH
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_one_board_or_one_left_in_its_plane_gives_no_sheet(method, noise: float) -> None:
    """With noise the points span the board's own plane, and no residual tells."""
    one = pose(np.random.default_rng(3))
    within = one.copy()
    within[:, 3] += 40.0 * one[:, 0]
    for place in (one[None], np.array([one, within])):
        xy, view, planes, _ = seen(place)
        xy = xy + noise * np.random.default_rng(4).normal(size=xy.shape)
        with pytest.raises(UntrustworthyError):
            method(xy, view, planes)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_boards_that_turn_about_the_light_give_no_sheet(noise: float) -> None:
    along = np.cross(NORMAL, [0.0, 0.1, 1.0])
    along /= np.linalg.norm(along)
    on_sheet = np.array([20.0, 10.0, 520.0])
    normals = [
        rotation(angle * along) @ np.cross(along, [1.0, 0.0, 0.0]) for angle in (0.0, 0.3, 0.5)
    ]
    normals = [n / np.linalg.norm(n) for n in normals]
    planes = np.array([[*n, n @ on_sheet] for n in normals])
    points = np.concatenate([light_on(p[:3], p[3], on_sheet, 60.0, 30) for p in planes])
    xy = project(points) + noise * np.random.default_rng(7).normal(size=(90, 2))
    view = np.repeat(np.arange(3), 30)
    with pytest.raises(UntrustworthyError, match="on one line"):
        sheet_by_points(xy, view, planes)
    with pytest.raises(UntrustworthyError, match="parallel in space"):
        sheet_by_vanishing_points(xy, view, planes)


@BOTH
def test_nothing_seen_gives_no_sheet(method) -> None:
    with pytest.raises(UntrustworthyError):
        method(np.zeros((0, 2)), np.zeros(0, dtype=int), np.zeros((0, 4)))
    xy, view, planes, _ = seen(poses(3, 8))
    behind = planes * [1, 1, 1, -1]
    with pytest.raises(UntrustworthyError):
        method(xy, view, behind)


def test_a_ray_along_a_plane_meets_it_nowhere() -> None:
    planes = np.array([[1.0, 0, 0, 30.0], [0, 0, 1.0, 30.0], [0, 0, 1.0, -30.0]])
    found = points_on_planes(np.array([[0.0, 0.2], [0.1, 0.2], [0.1, 0.2]]), planes)
    assert np.isnan(found[[0, 2]]).all()
    assert np.allclose(found[1], [3.0, 6.0, 30.0], rtol=0, atol=1e-12)


def test_lines_of_the_image_hold_their_points() -> None:
    xy = np.array([[0.0, 1.0], [1.0, 2.0], [3.0, 4.0], [5.0, 5.0], [6.0, 7.0], [6.0, 7.0]])
    lines = image_lines(xy, np.array([0, 0, 0, 1, 2, 2]), 4)
    assert np.allclose(np.c_[xy[:3], np.ones(3)] @ lines[0], 0.0, atol=1e-12)
    assert np.linalg.norm(lines[0, :2]) == pytest.approx(1.0)
    assert np.isnan(lines[1:]).all()
