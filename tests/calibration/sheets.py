"""A sheet of light, what it meets, and how well it was found; geometry composed by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sheetoflight.calibration.control_points import ControlledSheet
from sheetoflight.geometry.rotations import rotation

Points = np.ndarray

NORMAL = np.array([0.88, 0.12, 0.40])
NORMAL = NORMAL / np.linalg.norm(NORMAL)
DISTANCE = float(NORMAL @ np.array([20.0, 10.0, 520.0]))

_TANGENTS = np.linalg.svd(NORMAL[None])[2][1:]


def project(points: Points) -> Points:
    return points[..., :2] / points[..., 2:]


def met(first: Points, second: Points) -> Points:
    """Where lines through two points each meet the sheet."""
    way = second - first
    place = (DISTANCE - first @ NORMAL) / (way @ NORMAL)
    return first + place[..., None] * way


def common_line(
    normal: Points, offset: float, sheet: Points = NORMAL, distance: float = DISTANCE
) -> tuple[Points, Points]:
    """A point and the direction of the line in which the sheet meets the plane ``m · X = c``."""
    along = np.cross(sheet, normal)
    along /= np.linalg.norm(along)
    system = np.stack([sheet, normal, along])
    return np.linalg.solve(system, np.array([distance, offset, 0.0])), along


def light_on(normal: Points, offset: float, middle: Points, reach: float, count: int) -> Points:
    """Points of the line of light on a plane, about the one nearest to a middle."""
    point, along = common_line(normal, offset)
    start = point + ((middle - point) @ along) * along
    return start + np.linspace(-reach, reach, count)[:, None] * along


def pose(rng: np.random.Generator, turn: float = 0.3) -> Points:
    """A target's pose ``[R t]`` near the middle of the sheet."""
    R = rotation(turn * rng.normal(size=3))
    middle = np.array([20.0, 10.0, 520.0]) + rng.uniform(-25, 25, 3)
    return np.column_stack([R, middle])


def errors(found: ControlledSheet) -> Points:
    """Two tilts of the normal, and the error of the sheet's place near the target, over 100 mm."""
    middle = np.array([20.0, 10.0, 520.0])
    return np.array([*(_TANGENTS @ found.normal), (found.normal @ middle - found.distance) / 100])


def assert_exact(found: ControlledSheet) -> None:
    assert np.allclose(found.normal, NORMAL, rtol=0, atol=1e-9)
    assert abs(found.distance - DISTANCE) < 1e-9 * 520.0


def assert_noise_averages(
    measured: Callable[[int, np.random.Generator], ControlledSheet], trials: int = 300
) -> None:
    """Sixteen times the points, a quarter of the error; and no error that stays.

    The logarithm of a ratio of two roots of mean squares has a std of 1/√trials, the mean of the
    errors one of std/√trials: each is given 4 of them, which chance exceeds once in 16 000.
    """
    rng = np.random.default_rng(20)
    few = np.array([errors(measured(1, rng)) for _ in range(trials)])
    many = np.array([errors(measured(16, rng)) for _ in range(trials)])
    ratio = np.sqrt(np.mean(few**2, axis=0) / np.mean(many**2, axis=0))
    assert (np.abs(np.log(ratio / 4.0)) < 4.0 / np.sqrt(trials)).all()
    for sample in (few, many):
        assert (np.abs(sample.mean(axis=0)) < 4.0 * sample.std(axis=0) / np.sqrt(trials)).all()
