"""Surfaces: where the markers are, and which way a strip is turned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import normalised
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.paint import Disc, Quadrants
from sheetoflight.simulation.scene import (
    Surface,
    bar_surface,
    facing_direction,
    strip_axes,
    target_surface,
    wall_surface,
)

ORIGIN = np.array([-40.0, -90.0, 950.0])
DIRECTION = normalised(np.array([0.5, 0.7, 0.4]))
FACING = normalised(np.array([0.3, 0.1, -1.0]))
TARGET = CollinearTarget((0.0, 120.0, 260.0), marker_size_mm=30.0)


def test_painted_markers_stand_at_their_positions():
    strip = target_surface(TARGET, ORIGIN, DIRECTION, FACING)
    for paint, position in zip(strip.paint, TARGET.markers_mm, strict=True):
        painted = strip.centre + paint.a * strip.axes[0] + paint.b * strip.axes[1]
        np.testing.assert_allclose(painted, ORIGIN + position * DIRECTION, atol=1e-9)
        assert paint.reach == 15.0


def test_only_marker_0_is_black_along_the_target():
    paint = target_surface(TARGET, ORIGIN, DIRECTION, FACING).paint
    assert [isinstance(p, Quadrants) and p.along for p in paint] == [True, False, False]


def test_disc_target_is_painted_with_discs():
    target = CollinearTarget(marker="disc", marker_size_mm=10.0)
    paint = target_surface(target, ORIGIN, DIRECTION, FACING).paint
    assert all(isinstance(p, Disc) and p.reach == 5.0 for p in paint)
    assert not any(isinstance(p, Quadrants) for p in paint)


def test_strip_is_two_marker_sizes_high_and_one_longer_at_each_end():
    strip = target_surface(TARGET, ORIGIN, DIRECTION, FACING)
    assert 2 * strip.half_width == 60.0
    assert 2 * strip.half_length == 260.0 + 2 * 30.0


def test_no_other_turn_faces_better():
    """Among all turns about the strip's axis, the one taken looks most nearly at `FACING`."""
    along, across = strip_axes(DIRECTION, FACING)
    normal = np.cross(along, across)
    turns = np.linspace(0.0, 2 * np.pi, 721)
    others = np.cos(turns)[:, None] * normal + np.sin(turns)[:, None] * across
    assert abs(normal @ FACING) >= np.abs(others @ FACING).max() - 1e-12
    np.testing.assert_allclose(along, DIRECTION)


def test_facing_is_the_camera_or_midway_to_the_projector(small_rig):
    to_camera = facing_direction(small_rig, ORIGIN, laser=False)
    np.testing.assert_allclose(to_camera, -ORIGIN / np.linalg.norm(ORIGIN))
    midway = facing_direction(small_rig, ORIGIN, laser=True)
    to_projector = normalised(small_rig.projector_mm - ORIGIN)
    assert midway @ to_camera == pytest.approx(midway @ to_projector)


def test_bar_ends_at_its_ends():
    ends = np.stack([ORIGIN, ORIGIN + 173.0 * DIRECTION])
    bar = bar_surface(ends, FACING, width_mm=22.0)
    for sign, end in zip((-1.0, 1.0), ends, strict=True):
        reached = bar.centre + sign * bar.half_length * bar.axes[0]
        np.testing.assert_allclose(reached, end, atol=1e-9)
    assert bar.half_width == 11.0


def test_plane_holds_the_surface_and_looks_away_from_the_camera():
    normal, distance = target_surface(TARGET, ORIGIN, DIRECTION, FACING).plane
    assert normal @ ORIGIN == pytest.approx(distance)
    assert normal @ (ORIGIN + 55.0 * DIRECTION) == pytest.approx(distance)
    assert distance > 0


def test_wall_fills_the_picture(small_rig):
    """The rays of the picture's corners meet it within its size."""
    wall = wall_surface(small_rig, 1500.0)
    normal, distance = wall.plane
    width, height = small_rig.camera.image_size
    camera = small_rig.camera
    for u in (0, width):
        for v in (0, height):
            ray = np.array([(u - camera.u0) / camera.alpha, (v - camera.v0) / camera.beta, 1.0])
            a, b = wall.axes @ (ray * distance / (normal @ ray) - wall.centre)
            assert abs(a) < wall.half_length
            assert abs(b) < wall.half_width


def test_a_strip_cannot_face_along_itself():
    with pytest.raises(InputError, match="along its own length"):
        strip_axes(DIRECTION, -DIRECTION)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": np.array([[1.0, 0, 0], [0.6, 0.8, 0]])}, "at right angles"),
        ({"axes": np.eye(3)}, "axes of shape"),
        ({"half_width": 0.0}, "sizes above zero"),
        ({"half_length": math.nan}, "sizes above zero"),
    ],
    ids=["oblique", "three axes", "no width", "nan"],
)
def test_an_impossible_surface_is_refused(change, message):
    good = {
        "centre": np.array([0.0, 0.0, 900.0]),
        "axes": np.eye(3)[:2],
        "half_length": 10.0,
        "half_width": 5.0,
    }
    Surface(**good)
    with pytest.raises(InputError, match=message):
        Surface(**{**good, **change})
