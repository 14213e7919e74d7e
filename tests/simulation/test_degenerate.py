"""Degenerate recordings leave undetermined what they say, and are otherwise sound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.geometry.directions import Array
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.simulation import degenerate
from sheetoflight.simulation.degenerate import DEGENERATE
from sheetoflight.simulation.poses import Recording, recorded
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

EXACT = Recording(30, 10, 8)
NOISY = replace(EXACT, pixel_std=0.1)


def rigs() -> list[SimulatedRig]:
    return [paper_rig(), *(random_rig(np.random.default_rng(seed)) for seed in range(6))]


def seeded() -> np.random.Generator:
    return np.random.default_rng(1)


def directions(rig: SimulatedRig, seen: Observations) -> Array:
    """Directions ``(N, 3)`` of pivoting targets from exact image points of both ends.

    With the fixed point A and the rays ``q`` of marker 1, ``r`` of the last marker, the depths
    obey ``s_last z_q q − s_1 z_r r = (s_last − s_1) A``: three equations for two depths.
    """
    rays, positions = rig.camera.unproject(seen.camera.uv), rig.target.positions
    right = (positions[-1] - positions[1]) * rig.anchor_mm
    found = []
    for q, r in zip(rays[:, 1], rays[:, -1], strict=True):
        left = np.stack([positions[-1] * q, -positions[1] * r], axis=1)
        depths = np.linalg.lstsq(left, right)[0]
        found.append((depths[1] * r - rig.anchor_mm) / positions[-1])
    return np.array(found)


def equations_without_skew(along: Array) -> Array:
    """Rows of Zhang's equations ``eᵀ S e = 1`` with S₁₂ = 0."""
    x, y, z = along.T
    return np.stack([x * x, y * y, z * z, 2 * x * z, 2 * y * z], axis=1)


def rank(rows: Array) -> int:
    values = np.linalg.svd(rows, compute_uv=False)
    return int((values > 1e-7 * values[0]).sum())


# --- Swings ---------------------------------------------------------------------------------------


def test_random_swings_determine_the_camera():
    """The control: five independent equations."""
    for rig in rigs():
        along = directions(rig, recorded(rig, EXACT, seeded()))
        assert np.linalg.norm(along, axis=1) == pytest.approx(1.0)
        assert rank(equations_without_skew(along)) == 5


@pytest.mark.parametrize(
    ("swings", "expected"),
    [
        (degenerate.planar_swings, 3),
        (degenerate.swings_in_two_planes, 4),
        (degenerate.conical_swings, 4),
    ],
)
def test_degenerate_swings_lack_equations_even_without_skew(swings, expected):
    for rig in rigs():
        along = directions(rig, swings(rig, EXACT, seeded()))
        assert np.linalg.norm(along, axis=1) == pytest.approx(1.0)
        assert rank(equations_without_skew(along)) == expected


def test_planar_swings_lie_in_one_plane_beside_the_camera():
    for rig in rigs():
        along = directions(rig, degenerate.planar_swings(rig, EXACT, seeded()))
        _, values, axes = np.linalg.svd(along)
        assert values[2] < 1e-7 * values[0]
        to_sight = abs(axes[2] @ rig.anchor_mm) / np.linalg.norm(rig.anchor_mm)
        assert to_sight >= math.sin(math.radians(20.0)) - 1e-6


def test_swings_in_two_planes_alternate():
    for rig in rigs():
        along = directions(rig, degenerate.swings_in_two_planes(rig, EXACT, seeded()))
        assert rank(along[::2]) == rank(along[1::2]) == 2
        assert rank(along) == 3


def test_conical_swings_keep_one_angle_to_an_axis():
    """Unit vectors of a circular cone lie in a plane ``a · e = cos θ``."""
    for rig in rigs():
        along = directions(rig, degenerate.conical_swings(rig, EXACT, seeded()))
        axis = np.linalg.lstsq(along, np.ones(len(along)))[0]
        cosine = 1.0 / np.linalg.norm(axis)
        assert along @ axis == pytest.approx(1.0, abs=1e-6)
        assert 20.0 - 1e-4 < math.degrees(math.acos(cosine)) < 70.0 + 1e-4


@pytest.mark.parametrize(("name", "count"), [("one camera view", 1), ("two camera views", 2)])
def test_few_camera_views(name, count):
    seen = DEGENERATE[name](paper_rig(), NOISY, seeded())
    assert [len(views) for views in seen.stages().values()] == [count, 10, 8]


# --- Sheets ---------------------------------------------------------------------------------------


def test_a_repeated_position_differs_by_noise_alone():
    rig = paper_rig()
    exact, noisy = (
        degenerate.repeated_position(rig, recording, seeded()).plane.uv
        for recording in (EXACT, NOISY)
    )
    assert np.ptp(exact, axis=0).max() < 1e-12
    assert np.ptp(noisy, axis=0).min() > 0.0


def test_each_laser_repeats_a_position_of_its_own():
    rig = paper_rig()
    second = LightPlane(np.array([0.1, -0.85, 0.5]), 520.0, "second")
    both = replace(rig, light_planes=(rig.light_plane, second))
    uv = degenerate.repeated_position(both, EXACT, seeded()).plane.uv
    assert np.ptp(uv[:10], axis=0).max() < 1e-12
    assert np.ptp(uv[10:], axis=0).max() < 1e-12
    assert np.abs(uv[0] - uv[10]).max() > 1.0


def test_parallel_positions_are_parallel_and_in_the_sheet():
    for rig in rigs():
        seen = degenerate.parallel_positions(rig, EXACT, seeded())
        points = rig.light_plane.intersect(rig.camera.unproject(seen.plane.uv))
        along = points[:, -1] - points[:, 0]
        assert along.shape == (3, 3)
        assert np.linalg.norm(along, axis=1) == pytest.approx(rig.target.length_mm)
        assert np.abs(along - along[0]).max() < 1e-6 * rig.target.length_mm
        assert np.linalg.norm(points[1, 0] - points[0, 0]) > 0


def test_a_sheet_through_the_camera_is_seen_as_a_line():
    for rig in rigs():
        seen = degenerate.sheet_near_camera(rig, EXACT, seeded(), 0.0)
        spots = seen.crossing.uv[:, len(rig.target.positions) :].reshape(-1, 2)
        uv = np.concatenate([seen.plane.uv.reshape(-1, 2), spots])
        centred = uv - uv.mean(axis=0)
        values = np.linalg.svd(centred, compute_uv=False)
        assert values[1] < 1e-9 * values[0]


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01])
def test_a_sheet_near_the_camera_passes_it_at_the_distance(share):
    for rig in rigs():
        near = degenerate.with_sheet_at(rig, share * sum(rig.depth_mm) / 2)
        plane, old = near.light_plane, rig.light_plane
        assert plane.distance_mm == pytest.approx(share * sum(rig.depth_mm) / 2, abs=1e-9)
        across = old.normal[:2]
        z = sum(rig.depth_mm) / 2
        foot = across * (old.distance_mm - old.normal[2] * z) / (across @ across)
        for step in (0.0, z):
            on_both = np.append(foot + step * np.array([-across[1], across[0]]), z)
            assert old.normal @ on_both == pytest.approx(old.distance_mm)
            assert plane.normal @ on_both == pytest.approx(plane.distance_mm, abs=1e-9 * z)


# --- All of them ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DEGENERATE)
def test_every_image_point_is_in_the_picture_and_sound(name):
    for rig in rigs():
        seen = DEGENERATE[name](rig, EXACT, seeded())
        anchor = rig.camera.project(rig.anchor_mm)
        assert set(seen.stages()) == {"camera", "plane", "crossing"}
        for views in seen.stages().values():
            assert (views.uv >= 0).all()
            assert (views.uv <= np.array(rig.camera.image_size) - 1).all()
        assert seen.camera.uv[:, 0] == pytest.approx(np.tile(anchor, (len(seen.camera), 1)))
