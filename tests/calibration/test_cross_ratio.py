"""Control points from the invariance of the cross-ratio, and sheets through them."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.calibration.control_points import image_lines
from sheetoflight.calibration.cross_ratio import (
    cross_ratio_points,
    cross_ratio_sheet,
    positions_of_crossings,
)
from sheetoflight.errors import InputError, UntrustworthyError
from tests.calibration.sheets import (
    NORMAL,
    assert_exact,
    assert_noise_averages,
    light_on,
    met,
    pose,
    project,
)

LINES = 5
PLACES = np.array([-40.0, -12.0, 35.0])


def face(second: bool) -> tuple[np.ndarray, np.ndarray]:
    """Printed lines ``(5, 3, 3)`` across a face, target's frame, and the face's normal.

    The two faces are at an angle of about 106 degrees, and meet along x.
    """
    tilt = np.array([0.0, 0.8, 0.6 if second else -0.6])
    heights = np.linspace(10.0, 80.0, LINES) * (1.0 if second else -1.0)
    lines = heights[:, None, None] * tilt + PLACES[None, :, None] * np.array([1.0, 0.1, 0.0])
    lines[..., 2] = lines[..., 1] * tilt[2] / tilt[1]
    normal = np.cross([1.0, 0, 0], tilt)
    return lines, normal / np.linalg.norm(normal)


def view(place: np.ndarray, faces: tuple[bool, ...] = (False, True), samples: int = 2):
    """Known points, their image, images of the light as points ``(L, samples, 2)``, and the
    true control points in the target's frame."""
    known, light, true = [], [], []
    R, t = place[:, :3], place[:, 3]
    for second in faces:
        lines, normal = face(second)
        there = lines @ R.T + t
        m = R @ normal
        on_face = light_on(m, float(m @ t), there.mean(axis=(0, 1)), 50.0, samples)
        known.append(lines)
        light += [project(on_face)] * LINES
        true.append((met(there[:, 0], there[:, 2]) - t) @ R)
    points = np.concatenate(known)
    return points, project(points @ R.T + t), np.array(light), np.concatenate(true)


def fitted(light: np.ndarray) -> np.ndarray:
    member = np.repeat(np.arange(len(light)), light.shape[1])
    return image_lines(light.reshape(-1, 2), member, len(light))


def each(place: np.ndarray, count: int) -> np.ndarray:
    return np.repeat(place[None], count, axis=0)


@pytest.mark.parametrize("seed", range(8))
def test_one_exact_view_of_two_faces_gives_the_exact_sheet(seed: int) -> None:
    place = pose(np.random.default_rng(seed))
    points, xy, light, true = view(place)
    found = cross_ratio_sheet(points, xy, fitted(light), each(place, len(points)))
    assert_exact(found)
    assert np.allclose(found.points, true @ place[:, :3].T + place[:, 3], rtol=0, atol=1e-9 * 520)


def test_two_exact_views_of_one_face_give_the_exact_sheet() -> None:
    rng = np.random.default_rng(1)
    places = [pose(rng), pose(rng)]
    views = [view(place, (False,)) for place in places]
    points, xy, light = (np.concatenate([v[i] for v in views]) for i in range(3))
    poses = np.concatenate([each(place, LINES) for place in places])
    assert_exact(cross_ratio_sheet(points, xy, fitted(light), poses))


def ratio(a: float, b: float, c: float, d: float) -> float:
    """Cross-ratio of four points of a line."""
    return (c - a) * (d - b) / ((c - b) * (d - a))


def test_the_crossing_has_the_cross_ratio_of_its_image() -> None:
    """Noise or not: with three known points the ratio in space is that of the picture."""
    place = pose(np.random.default_rng(2))
    _, xy, light, _ = view(place)
    xy = xy.copy()
    rng = np.random.default_rng(3)
    stripes = fitted(light + 1e-3 * rng.normal(size=light.shape))
    found = positions_of_crossings(np.tile(PLACES, (len(xy), 1)), xy, stripes)
    for s, points, stripe in zip(found, xy, stripes, strict=True):
        own = np.cross([*points[0], 1.0], [*points[2], 1.0])
        crossing = np.cross(own, stripe)
        axis = points[2] - points[0]
        a, b, c = points @ axis
        image = ratio(a, b, c, float(crossing[:2] @ axis / crossing[2]))
        first, second, third = PLACES
        assert ratio(first, second, third, s) == pytest.approx(image, rel=1e-9)


def test_no_camera_enters_the_control_points() -> None:
    place = pose(np.random.default_rng(4))
    points, xy, light, true = view(place)
    H = np.array([[1500.0, 3.0, 640.0], [-20.0, 1400.0, 500.0], [0.1, -0.2, 1.0]])

    def mapped(image: np.ndarray) -> np.ndarray:
        return project(np.concatenate([image, np.ones_like(image[..., :1])], axis=-1) @ H.T)

    found = cross_ratio_points(points, mapped(xy), fitted(mapped(light)))
    assert np.allclose(found, true, rtol=0, atol=1e-9 * 520)


def test_more_known_points_say_the_same_and_unseen_ones_nothing() -> None:
    place = pose(np.random.default_rng(5))
    points, xy, light, true = view(place)
    R, t = place[:, :3], place[:, 3]
    more = 0.5 * (points[:, 1:2] + points[:, 2:])
    points = np.concatenate([points, more, 2.0 * more - points[:, :1]], axis=1)
    xy = np.concatenate([xy, project(points[:, 3:] @ R.T + t)], axis=1)
    assert np.allclose(cross_ratio_points(points, xy, fitted(light)), true, rtol=0, atol=5e-7)
    xy[:, [0, 3]] = np.nan
    assert np.allclose(cross_ratio_points(points, xy, fitted(light)), true, rtol=0, atol=5e-7)
    xy[2, 1] = np.nan
    found = cross_ratio_points(points, xy, fitted(light))
    assert np.isnan(found[2]).all()
    assert np.allclose(np.delete(found, 2, 0), np.delete(true, 2, 0), rtol=0, atol=5e-7)


def test_noise_averages_out() -> None:
    place = pose(np.random.default_rng(6))
    points, xy, light, _ = view(place, samples=10)

    def measured(repeats: int, rng: np.random.Generator):
        known, image = np.tile(points, (repeats, 1, 1)), np.tile(xy, (repeats, 1, 1))
        on = np.tile(light, (repeats, 1, 1))
        stripes = fitted(on + 1e-5 * rng.normal(size=on.shape))
        image = image + 1e-5 * rng.normal(size=image.shape)
        return cross_ratio_sheet(known, image, stripes, each(place, len(known)))

    assert_noise_averages(measured, 150)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_one_face_in_one_view_gives_no_sheet(noise: float) -> None:
    place = pose(np.random.default_rng(7))
    points, xy, light, _ = view(place, (True,))
    xy = xy + noise * np.random.default_rng(8).normal(size=xy.shape)
    with pytest.raises(UntrustworthyError, match="lie in one plane"):
        cross_ratio_sheet(points, xy, fitted(light), each(place, LINES))


def test_light_along_the_printed_lines_gives_no_sheet() -> None:
    place = pose(np.random.default_rng(9))
    points, xy, _, _ = view(place)
    beside = np.cross(
        np.concatenate([xy[:, 0] + [0.0, 0.01], np.ones((10, 1))], axis=1),
        np.concatenate([xy[:, 2] + [0.0, 0.01], np.ones((10, 1))], axis=1),
    )
    with pytest.raises(UntrustworthyError, match="no line of the target"):
        cross_ratio_sheet(points, xy, beside, each(place, len(points)))


def test_two_known_points_are_too_few() -> None:
    points, xy, light, _ = view(pose(np.random.default_rng(10)))
    assert np.isnan(cross_ratio_points(points[:, :2], xy[:, :2], fitted(light))).all()


def test_a_crossing_behind_the_camera_is_none() -> None:
    """Along z = 100 + s the image of x = 10 is 10 / (100 + s): s = −150 is seen at −0.2."""
    known = np.array([[0.0, 50.0, 120.0]])
    xy = np.stack([10.0 / (100.0 + known), np.zeros((1, 3))], axis=-1)
    for s, there in ((-60.0, True), (-150.0, False)):
        found = positions_of_crossings(known, xy, np.array([[1.0, 0.0, -10.0 / (100.0 + s)]]))
        assert np.isfinite(found).all() == there
        if there:
            assert found[0] == pytest.approx(s, abs=1e-9)


def test_known_points_must_be_collinear() -> None:
    points, xy, light, _ = view(pose(np.random.default_rng(11)))
    bent = points.copy()
    bent[3, 1] += 0.5 * NORMAL
    with pytest.raises(InputError, match="line 3"):
        cross_ratio_points(bent, xy, fitted(light))
