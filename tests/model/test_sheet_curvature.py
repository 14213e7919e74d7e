"""A curved sheet of light: what its surface is, and where rays meet it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.nominal import NominalRig
from sheetoflight.model.sheet_curvature import SheetCurvature, curvature_about

NORMAL, DISTANCE = np.array([0.90980, 0.08722, 0.40578]), 562.334
CENTRE = np.array([150.0, 20.0, 1050.0])
BENT = (3e-5, -1e-5, -2e-5)


def sheet(per_mm: tuple[float, float, float] = BENT) -> LightPlane:
    return LightPlane(NORMAL, DISTANCE, "red", curvature_about(NORMAL, CENTRE, np.array(per_mm)))


def rays(count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.append(rng.uniform(-0.25, 0.25, (count, 2)), np.ones((count, 1)), axis=1)


def height_by_hand(plane: LightPlane, point: np.ndarray) -> float:
    """The formula of the format, number by number."""
    bend = plane.curvature
    assert bend is not None
    x = sum(bend.axes[i, 0] * (point[i] - bend.centre[i]) for i in range(3))
    y = sum(bend.axes[i, 1] * (point[i] - bend.centre[i]) for i in range(3))
    kxx, kxy, kyy = bend.per_mm
    above = sum(plane.normal[i] * point[i] for i in range(3)) - plane.distance_mm
    return float(above - 0.5 * (kxx * x * x + 2.0 * kxy * x * y + kyy * y * y))


def test_without_curvature_a_ray_meets_the_plane():
    flat, bent = LightPlane(NORMAL, DISTANCE), sheet((0.0, 0.0, 0.0))
    every = np.concatenate([rays(), -rays(), [[-NORMAL[2], 0.0, NORMAL[0]]]])
    np.testing.assert_allclose(bent.intersect(every), flat.intersect(every), rtol=1e-12)
    assert np.isnan(bent.intersect(-rays())).all()


def test_rays_meet_the_sheet_on_the_sheet():
    plane = sheet()
    points = plane.intersect(rays())
    assert np.abs(np.cross(points, rays())).max() < 1e-9
    assert max(abs(height_by_hand(plane, point)) for point in points) < 1e-9
    assert np.abs(points - LightPlane(NORMAL, DISTANCE).intersect(rays())).max() > 0.1


def test_the_meeting_goes_over_into_the_planes_as_the_curvature_vanishes():
    flat = LightPlane(NORMAL, DISTANCE).intersect(rays())
    off = [
        np.abs(sheet((3 * k, -k, -2 * k)).intersect(rays()) - flat).max()
        for k in (1e-6, 1e-7, 1e-8, 1e-12)
    ]
    np.testing.assert_allclose(np.divide(off[:3], off[1:]), [10.0, 10.0, 1e4], rtol=0.05)


def test_a_sphere_is_met_where_its_cap_is():
    radius = 40_000.0  # mm: near its pole a sphere is the sheet to fourth order
    normal = NORMAL / np.linalg.norm(NORMAL)
    pole = normal * DISTANCE + 900.0 * np.cross(normal, [0.0, 1.0, 0.0])
    if pole[2] < 0:
        pole = 2 * normal * DISTANCE - pole
    ball = pole + radius * normal
    bend = curvature_about(normal, pole, np.array([1.0, 0.0, 1.0]) / radius)
    ahead = pole + np.random.default_rng(2).uniform(-60.0, 60.0, (50, 3))
    along = ahead / ahead[:, 2:]
    a, b = np.sum(along**2, axis=1), along @ ball
    depth = (b - np.sqrt(b * b - a * (ball @ ball - radius**2))) / a
    found = LightPlane(normal, float(normal @ pole), curvature=bend).intersect(along)
    assert np.abs(found[:, 2] - depth).max() < 1e-4
    np.testing.assert_allclose(found / depth[:, None], along, atol=1e-6)


def test_a_ray_that_misses_the_sheet_has_no_point():
    # z = 1000 + ½ k x²: along x = z that is 0.05 z² − z + 1000 = 0, which has no root
    bend = SheetCurvature(np.array([0.0, 0.0, 1000.0]), np.eye(3)[:, :2], np.array([0.1, 0, 0]))
    plane = LightPlane(np.array([0.0, 0.0, 1.0]), 1000.0, curvature=bend)
    met = plane.intersect(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]))
    np.testing.assert_allclose(met[0], [0.0, 0.0, 1000.0])
    assert np.isnan(met[1]).all()


def test_lines_from_anywhere_meet_the_sheet_like_rays():
    plane, directions = sheet(), rays()
    origins = np.random.default_rng(3).uniform(-200.0, 200.0, directions.shape)
    points = origins + plane.along(origins, directions)[:, None] * directions
    assert np.abs(plane.heights(points)).max() < 1e-9
    np.testing.assert_allclose(plane.along(points - 7.0 * directions, directions), 7.0, atol=1e-8)


def test_gradients_are_the_derivatives_of_the_heights():
    plane, points, step = sheet(), CENTRE + rays() * [400.0, 400.0, 30.0], 1e-3
    for axis in np.eye(3):
        by_difference = (
            plane.heights(points + step * axis) - plane.heights(points - step * axis)
        ) / (2 * step)
        np.testing.assert_allclose(plane.gradients(points) @ axis, by_difference, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(plane.normals_at(points), axis=1), 1.0)


def test_the_surface_does_not_depend_on_the_axes():
    normal = NORMAL / np.linalg.norm(NORMAL)
    bend = sheet().curvature
    assert bend is not None
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    turned_k = turn.T @ bend.matrix @ turn
    turned = SheetCurvature(
        CENTRE, bend.axes @ turn, np.array([turned_k[0, 0], turned_k[0, 1], turned_k[1, 1]])
    )
    other = LightPlane(normal, DISTANCE, curvature=turned)
    np.testing.assert_allclose(other.intersect(rays()), sheet().intersect(rays()), rtol=1e-12)


def test_axes_are_made_in_the_plane():
    bend = curvature_about(2 * NORMAL, CENTRE, np.array(BENT), first_axis=np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(bend.axes.T @ bend.axes, np.eye(2), atol=1e-15)
    assert np.abs(NORMAL @ bend.axes).max() < 1e-15
    assert bend.axes[1, 0] > 0.99


def test_parameters_are_named_as_in_a_covariance():
    flat = ["red.nx", "red.ny", "red.nz", "red.d"]
    assert list(LightPlane(NORMAL, DISTANCE, "red").parameters) == flat
    found = sheet().parameters
    assert list(found) == [*flat, "red.kxx", "red.kxy", "red.kyy"]
    assert [found["red.kxx"], found["red.kxy"], found["red.kyy"]] == list(BENT)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("centre", [0.0, 0.0]),
        ("centre", [0.0, math.nan, 0.0]),
        ("axes", np.eye(3)),
        ("axes", [[1.0, 0.1], [0.0, 1.0], [0.0, 0.0]]),
        ("axes", [[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
        ("per_mm", [1e-5, math.inf, 0.0]),
        ("per_mm", [1e-5]),
    ],
)
def test_a_curvature_that_cannot_be_is_refused(part, value):
    good = {"centre": CENTRE, "axes": np.eye(3)[:, :2], "per_mm": BENT}
    SheetCurvature(**good)
    with pytest.raises(InputError, match="curvature"):
        SheetCurvature(**good | {part: value})


def test_axes_out_of_the_plane_are_refused():
    bend = SheetCurvature(CENTRE, np.eye(3)[:, :2], np.array(BENT))
    LightPlane(np.array([0.0, 0.0, 1.0]), 1.0, curvature=bend)
    with pytest.raises(InputError, match="out of the plane"):
        LightPlane(NORMAL, DISTANCE, curvature=bend)


def test_plans_are_of_flat_sheets():
    camera = Camera((1392, 1040), 2298.7, 2288.8, 689.3, 537.9)
    NominalRig(camera, (LightPlane(NORMAL, DISTANCE),), CENTRE, (900.0, 1300.0))
    with pytest.raises(InputError, match="'red' is curved"):
        NominalRig(camera, (sheet(),), CENTRE, (900.0, 1300.0))
