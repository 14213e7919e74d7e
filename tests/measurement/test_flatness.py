"""Planes through points in space: laws, statistics, and a real scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.rotations import rotation
from sheetoflight.io.clouds import read_cloud
from sheetoflight.measurement.flatness import fitted_plane_in_space

CICLOP = Path(__file__).resolve().parents[3] / "shared" / "real" / "ciclop_3dscanscience"
TURN = rotation(np.array([0.4, -0.9, 0.2]))


def flat(rng, count=2000, std=0.05):
    """Points of a plane at 150 mm with normal noise; normal, and distance."""
    points = rng.uniform(-30.0, 30.0, (count, 3))
    points[:, 2] = 150.0 + rng.normal(0.0, 1.0, count) * std
    return points @ TURN.T, TURN[:, 2], 150.0


def test_points_of_a_plane_give_it_back():
    xyz, normal, distance = flat(np.random.default_rng(1), std=0.0)
    plane = fitted_plane_in_space(xyz)
    assert plane.normal == pytest.approx(normal * np.sign(plane.normal @ normal), abs=1e-12)
    assert plane.distance_mm == pytest.approx(distance, abs=1e-10)
    assert plane.rms_mm < 1e-12
    assert plane.flatness_mm < 1e-11


def test_moving_the_points_moves_the_plane():
    xyz, _, _ = flat(np.random.default_rng(2))
    before = fitted_plane_in_space(xyz)
    turn, shift = rotation(np.array([1.0, 0.3, -0.2])), np.array([3.0, -8.0, 500.0])
    after = fitted_plane_in_space(xyz @ turn.T + shift)
    turned = turn @ before.normal
    assert abs(after.normal @ turned) == pytest.approx(1.0, abs=1e-12)
    assert after.distance_mm == pytest.approx(abs(before.distance_mm + turned @ shift), abs=1e-9)
    assert after.flatness_mm == pytest.approx(before.flatness_mm, abs=1e-9)


def test_rms_and_flatness_are_those_of_the_noise():
    """2000 residuals: their rms strays from the noise by 1.6 % (1 sigma), 3.9 sigma once in
    10 000 times. Their range has mean 6.87 and standard deviation 0.43 sigma (Tippett 1925)."""
    xyz, _, _ = flat(np.random.default_rng(3))
    plane = fitted_plane_in_space(xyz)
    assert plane.rms_mm == pytest.approx(0.05, rel=0.065)
    assert plane.flatness_mm == pytest.approx(0.05 * 6.87, abs=0.05 * 0.43 * 4.5)


def test_uncertain_points_count_less():
    """Half of the points are moved by 1 mm, and said to be uncertain by 1 mm, the others by
    0.01 mm: they weigh 1e-4 and move the plane by 1e-4 mm."""
    xyz, normal, distance = flat(np.random.default_rng(4), std=0.0)
    std = np.where(np.arange(len(xyz)) % 2, 1.0, 0.01)
    moved = xyz + np.where(std == 1.0, 1.0, 0.0)[:, None] * normal
    assert fitted_plane_in_space(moved, std).distance_mm == pytest.approx(distance, abs=3e-4)
    assert fitted_plane_in_space(moved).distance_mm == pytest.approx(distance + 0.5, abs=0.1)


def test_points_off_the_plane_are_left_out():
    """A third of the points lies 1 to 20 mm above; least squares follows them."""
    rng = np.random.default_rng(5)
    xyz, normal, distance = flat(rng)
    off = np.arange(len(xyz)) % 3 == 0
    xyz[off] += rng.uniform(1.0, 20.0, off.sum())[:, None] * normal
    plane = fitted_plane_in_space(xyz, robust_mm=0.25)
    assert abs(fitted_plane_in_space(xyz).distance_mm - distance) > 1.0
    assert plane.distance_mm == pytest.approx(distance, abs=0.02)
    assert np.array_equal(plane.inliers, ~off)


@pytest.mark.parametrize("robust_mm", [None, 0.1])
def test_a_line_is_no_plane(robust_mm):
    line = np.outer(np.linspace(0.0, 50.0, 40), [1.0, 2.0, 3.0])
    with pytest.raises(UntrustworthyError, match="one line"):
        fitted_plane_in_space(line, robust_mm=robust_mm)


@pytest.mark.parametrize(
    ("xyz", "std", "robust_mm"),
    [
        (np.zeros((2, 3)), None, None),
        (np.zeros((5, 2)), None, None),
        (np.full((5, 3), np.nan), None, None),
        (np.eye(3), np.zeros(3), None),
        (np.eye(3), np.ones(4), None),
        (np.eye(3), None, 0.0),
    ],
)
def test_bad_input_is_refused(xyz, std, robust_mm):
    with pytest.raises(InputError):
        fitted_plane_in_space(xyz, std, robust_mm)


@pytest.mark.skipif(not CICLOP.is_dir(), reason="the point cloud is not here: no ../shared/real")
def test_a_scanned_plane_has_its_published_figures():
    """Ciclop's own figures, least squares; and a consensus at 0.1 mm, which chance moves by
    some 0.1 mm: the plane stands 160 mm away and is seen at 32° only."""
    xyz = read_cloud(CICLOP / "laser-pc.ply")
    plane = fitted_plane_in_space(xyz)
    assert len(xyz) == 5975
    assert plane.normal == pytest.approx([0.851109, -0.001229, 0.524988], abs=2e-6)
    assert plane.distance_mm == pytest.approx(159.5269, abs=3e-4)
    assert plane.rms_mm == pytest.approx(0.08841, abs=1e-5)
    robust = fitted_plane_in_space(xyz, robust_mm=0.1)
    assert robust.distance_mm == pytest.approx(160.235, abs=0.1)
    assert robust.rms_mm == pytest.approx(0.054, abs=0.005)
