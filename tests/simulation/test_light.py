"""The sheet of light on surfaces, against ray casting done here point by point."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.geometry.directions import normalised
from sheetoflight.simulation.render import RenderOptions, brightness
from sheetoflight.simulation.scene import (
    Scene,
    Surface,
    bar_surface,
    facing_direction,
    wall_surface,
)

DARK = RenderOptions(ambient_level=0.0, vignetting=0.0, defocus_px=0.0)


def wall_line(rig, wall: Surface, count: int) -> np.ndarray:
    """Points (count, 3) along the line in which the sheet meets the wall."""
    normal, distance = wall.plane
    sheet = rig.light_plane
    along = normalised(np.cross(normal, sheet.normal).astype(float))
    along *= np.sign(along[1])
    middle = np.linalg.solve(
        np.stack([normal, sheet.normal, along]), [distance, sheet.distance_mm, 0.0]
    )
    return middle + np.linspace(-500.0, 500.0, count)[:, None] * along


def blocked(start: np.ndarray, end: np.ndarray, surface: Surface) -> tuple[bool, float]:
    """Whether a segment meets a rectangle, and how near its outline it passes, mm."""
    normal = np.cross(*surface.axes)
    before, after = ((p - surface.centre) @ normal for p in (start, end))
    if before * after > 0:
        return False, np.inf
    hit = start + (end - start) * before / (before - after)
    a, b = np.abs(surface.axes @ (hit - surface.centre))
    inside = min(surface.half_length - a, surface.half_width - b)
    return bool(inside > 0), abs(float(inside))


def held_bar(rig) -> Surface:
    """A bar in the sheet in front of the wall."""
    middle = np.array([0.0, 10.0, 900.0])
    middle[0] = (
        rig.light_plane.distance_mm - middle[1:] @ rig.light_plane.normal[1:]
    ) / rig.light_plane.normal[0]
    along = normalised(np.cross(rig.light_plane.normal, np.array([1.0, 0.0, 0.6])))
    ends = np.stack([middle - 80.0 * along, middle + 80.0 * along])
    return bar_surface(ends, facing_direction(rig, middle, laser=True))


def test_shadow_is_where_the_bar_hides_the_projector(small_rig):
    """Along the line on the wall, light arrives exactly where no ray from the projector
    meets the bar; points within 3 mm of its outline are left out as half lit."""
    wall, bar = wall_surface(small_rig, 1500.0), held_bar(small_rig)
    picture = brightness(small_rig, Scene((wall, bar)), DARK, laser=True)
    alone = brightness(small_rig, Scene((wall,)), DARK, laser=True)
    counts = {True: 0, False: 0}
    for point in wall_line(small_rig, wall, 400):
        u, v = np.rint(small_rig.camera.project(point)).astype(int)
        hidden, _ = blocked(np.zeros(3), point, bar)
        shaded, margin = blocked(small_rig.projector_mm, point, bar)
        if not (0 <= u < 320 and 0 <= v < 240) or hidden or margin < 3.0:
            continue
        counts[shaded] += 1
        expected = 0.0 if shaded else alone[v, u]
        assert picture[v, u] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert min(counts.values()) > 20


def test_bar_itself_is_lit_along_its_axis(small_rig):
    """Its own surface does not shade it, and the wall behind does not either."""
    bar = held_bar(small_rig)
    picture = brightness(small_rig, Scene((wall_surface(small_rig, 1500.0), bar)), DARK, True)
    for s in np.linspace(-70.0, 70.0, 9):
        u, v = np.rint(small_rig.camera.project(bar.centre + s * bar.axes[0])).astype(int)
        assert picture[v, u] > 0.1


def test_line_brightness_follows_distance_and_incidence(small_rig):
    """The light of one picture row is ``level · reflectance · (R0/R) · cos`` times the
    profile's area ``√(2π) σ`` divided by the sheet's distance per pixel.

    The oracle works in space: X by intersecting sheet, wall and the row's plane, R and the
    cosine by vectors, the distance per pixel by moving one pixel to either side. Across the
    line R and the scale change by 1/500 per pixel, linearly, so that (1/500)² is left; the
    profile's tails beyond five standard deviations hold 6e-7.
    """
    camera, sheet = small_rig.camera, small_rig.light_plane
    for turn in (0.0, 0.4):
        wall = wall_surface(small_rig, 1100.0, turn=turn)
        picture = brightness(small_rig, Scene((wall,)), DARK, laser=True)
        normal, distance = wall.plane
        for v in (40, 118, 190):
            row = np.array([0.0, 1.0, -(v - camera.v0) / camera.beta])
            x = np.linalg.solve(
                np.stack([sheet.normal, normal, row]), [sheet.distance_mm, distance, 0.0]
            )
            light = small_rig.projector_mm - x
            cosine = abs(light @ normal) / np.linalg.norm(light)
            aside = x / x[2] + np.array([[1.0], [-1.0]]) / camera.alpha * [1.0, 0.0, 0.0]
            aside *= distance / (aside @ normal)[:, None]
            per_px = abs((aside[0] - aside[1]) @ sheet.normal) / 2
            level = DARK.laser_level * wall.reflectance * cosine
            level *= DARK.laser_reference_mm / np.linalg.norm(light)
            expected = level * np.sqrt(2 * np.pi) * DARK.sheet_sigma_mm / per_px
            assert picture[v].sum() == pytest.approx(expected, rel=5e-6)


def test_a_surface_lit_from_behind_stays_dark(small_rig):
    """The camera sees the side that the projector does not."""
    point = held_bar(small_rig).centre
    to_camera, to_projector = normalised(-point), normalised(small_rig.projector_mm - point)
    normal = normalised(to_camera - to_projector)  # faces the camera, turns its back to the light
    assert normal @ to_camera > 0 > normal @ to_projector
    first = normalised(np.cross(normal, [0.0, 1.0, 0.0]))
    board = Surface(point, np.stack([first, np.cross(normal, first)]), 60.0, 60.0)
    assert brightness(small_rig, Scene((board,)), DARK, laser=True).max() == 0.0


def test_light_needs_the_laser_switched_on(small_rig):
    scene = Scene((wall_surface(small_rig, 1100.0),))
    assert brightness(small_rig, scene, DARK, laser=False).max() == 0.0
    assert brightness(small_rig, scene, DARK, laser=True).max() > 0.0
