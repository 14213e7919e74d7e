"""Sheets from spots on the ridges of a zigzag target."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from sheetoflight.calibration.zigzag import (
    spots_on_ridges,
    stripes_on_ridges,
    zigzag_sheet,
    zigzag_sheet_of_stripes,
)
from sheetoflight.errors import UntrustworthyError
from tests.calibration.sheets import (
    NORMAL,
    assert_exact,
    assert_noise_averages,
    met,
    pose,
    project,
)


def ridges(relief: float = 30.0, count: int = 8) -> np.ndarray:
    """Crests and troughs by turns along y; the ridges run along x, target's frame."""
    y = np.linspace(-60.0, 60.0, count)
    z = relief * (np.arange(count) % 2)
    ends = np.array([[-50.0, 0, 0], [50.0, 0, 0]])
    return np.stack([np.zeros(count), y, z], axis=1)[:, None] + ends


def placed(lines: np.ndarray, place: np.ndarray) -> np.ndarray:
    return np.asarray(lines @ place[:, :3].T + place[:, 3])


def crossed(lines: np.ndarray, place: np.ndarray) -> np.ndarray:
    ends = placed(lines, place)
    return met(ends[:, 0], ends[:, 1])


def stripes(spots: np.ndarray) -> np.ndarray:
    """The line of light on the slope beside each ridge: it joins this spot and the next one."""
    image = np.column_stack([project(spots), np.ones(len(spots))])
    return np.cross(image, np.roll(image, -1, axis=0))


def one_pose(lines: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    place = pose(np.random.default_rng(seed))
    return place, np.repeat(place[None], len(lines), axis=0)


@pytest.mark.parametrize("seed", range(8))
def test_one_exact_view_gives_the_exact_sheet(seed: int) -> None:
    lines = ridges()
    place, each = one_pose(lines, seed)
    spots = crossed(lines, place)
    found = zigzag_sheet(project(spots), lines, each)
    assert_exact(found)
    assert np.allclose(found.points, spots, rtol=0, atol=1e-9 * 520)
    by_stripes = zigzag_sheet_of_stripes(stripes(spots), lines, each)
    assert_exact(by_stripes)
    assert np.allclose(by_stripes.points, spots, rtol=0, atol=1e-9 * 520)


def test_a_spot_is_the_ridges_point_nearest_to_its_ray() -> None:
    lines = placed(ridges(count=4), pose(np.random.default_rng(2)))
    xy = project(met(lines[:, 0], lines[:, 1])) + 0.01 * np.random.default_rng(3).normal(
        size=(4, 2)
    )
    for point, line, image in zip(spots_on_ridges(xy, lines), lines, xy, strict=True):
        ray = np.array([*image, 1.0]) / np.linalg.norm([*image, 1.0])

        def off(place: np.ndarray, line=line, ray=ray) -> float:
            return float(np.sum(np.cross(line[0] + place * (line[1] - line[0]), ray) ** 2))

        best = minimize(off, [0.5]).x
        assert np.allclose(point, line[0] + best * (line[1] - line[0]), atol=1e-4)
        assert abs(np.linalg.norm(np.cross(line[1] - line[0], point - line[0]))) < 1e-9 * 1e4


def test_which_two_points_name_a_ridge_does_not_matter() -> None:
    lines = ridges()
    place, each = one_pose(lines, 4)
    xy = project(crossed(lines, place)) + 1e-4 * np.random.default_rng(5).normal(size=(8, 2))
    other = lines[:, ::-1] * 2.0 - lines.mean(axis=1)[:, None] + [3.0, 0.0, 0.0]
    one, two = zigzag_sheet(xy, lines, each), zigzag_sheet(xy, other, each)
    assert np.allclose(one.points, two.points, rtol=0, atol=1e-9 * 520)


def test_noise_averages_out() -> None:
    lines = ridges()
    place, _ = one_pose(lines, 6)
    xy = project(crossed(lines, place))

    def measured(repeats: int, rng: np.random.Generator):
        many = np.tile(xy, (repeats, 1))
        return zigzag_sheet(
            many + 2e-5 * rng.normal(size=many.shape),
            np.tile(lines, (repeats, 1, 1)),
            np.repeat(place[None], len(many), axis=0),
        )

    assert_noise_averages(measured)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_ridges_of_one_height_need_a_second_view(noise: float) -> None:
    """Spots on the crests are on one line; noise spreads them in the plane of the crests."""
    lines = ridges(relief=0.0)
    rng = np.random.default_rng(7)
    places = [pose(rng), pose(rng)]
    xy = [project(crossed(lines, p)) + noise * rng.normal(size=(8, 2)) for p in places]
    each = [np.repeat(p[None], 8, axis=0) for p in places]
    with pytest.raises(UntrustworthyError, match="lie in one plane"):
        zigzag_sheet(xy[0], lines, each[0])
    both = zigzag_sheet(np.concatenate(xy), np.r_[lines, lines], np.concatenate(each))
    if noise == 0.0:
        assert_exact(both)
    assert float(both.normal @ NORMAL) > 0.999


def test_unseen_spots_are_left_out() -> None:
    lines = ridges()
    place, each = one_pose(lines, 8)
    xy = project(crossed(lines, place))
    xy[[1, 4]] = np.nan
    found = zigzag_sheet(xy, lines, each)
    assert_exact(found)
    assert np.isnan(found.points[[1, 4]]).all()
    xy[[0, 2, 3, 5]] = np.nan
    with pytest.raises(UntrustworthyError, match="2 points"):
        zigzag_sheet(xy, lines, each)
    with pytest.raises(UntrustworthyError, match="no ridge"):
        zigzag_sheet(np.full((8, 2), np.nan), lines, each)


def test_ridges_seen_end_on_or_behind_the_camera_give_no_point() -> None:
    end_on = np.array([[[0.0, 0, 300], [0.5, 0, 400]]])  # 0.3 degrees off the ray
    behind = np.array([[[-10.0, 0, -300], [10, 0, -300]]])
    assert np.isnan(spots_on_ridges(np.zeros((1, 2)), end_on)).all()
    assert np.isnan(spots_on_ridges(np.zeros((1, 2)), behind)).all()
    along = np.array([[0.0, 1.0, 0.0]])  # y = 0 in the image, and the ridge in that plane
    assert np.isnan(stripes_on_ridges(along, np.array([[[-9.0, 0, 300], [9, 0.1, 300]]]))).all()
