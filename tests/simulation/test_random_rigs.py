"""Random rigs keep within their stated ranges, and fill them."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy import stats

from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation import random_rigs
from sheetoflight.simulation.poses import observed_rig, segments_in_sheet
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

SEEDS = 200
ODDS = 1e-6


@cache
def rigs() -> tuple[SimulatedRig, ...]:
    return tuple(random_rig(np.random.default_rng(seed)) for seed in range(SEEDS))


def distance(rig: SimulatedRig) -> float:
    return sum(rig.depth_mm) / 2


def test_cameras_are_within_their_ranges():
    for rig in rigs():
        camera, (width, height) = rig.camera, rig.camera.image_size
        field = 2 * math.degrees(math.atan(width / 2 / camera.alpha))
        assert 600 <= camera.alpha <= 6000
        assert abs(camera.beta / camera.alpha - 1) <= 0.01
        assert abs(camera.u0 - (width - 1) / 2) <= 0.03 * width
        assert abs(camera.v0 - (height - 1) / 2) <= 0.03 * height
        assert 8 <= field <= 75
        assert not camera.distorts


def test_sheets_are_within_their_ranges():
    for rig in rigs():
        plane = rig.light_plane
        assert 15 <= math.degrees(math.asin(abs(plane.normal[2]))) <= 70
        assert plane.distance_mm > 0.1 * distance(rig)
        assert plane.normal @ rig.projector_mm == pytest.approx(plane.distance_mm)


def test_targets_and_depths_are_within_their_ranges():
    for rig in rigs():
        camera, target, z = rig.camera, rig.target, distance(rig)
        field = np.array(camera.image_size) / [camera.alpha, camera.beta] * z
        gaps = np.diff(target.positions)
        reach = (rig.depth_mm[1] - rig.depth_mm[0]) / 2 / z
        assert 100 <= z <= 5000
        assert 0.15 - 1e-12 <= reach <= 0.25 + 1e-12
        assert 0.25 <= target.length_mm / field.min() <= 0.60
        assert 3 <= len(target.positions) <= 9
        assert np.ptp(gaps) > 0
        assert target.marker_size_mm < gaps.min()
        assert rig.anchor_mm[2] == pytest.approx(z, rel=0.05)
        uv = camera.project(rig.anchor_mm)
        assert (uv > 0).all()
        assert (uv < np.array(camera.image_size) - 1).all()


def test_rigs_fill_their_ranges():
    """Kolmogorov and Smirnov's test of each distribution, odds of 1e-6."""
    normals = np.array([rig.light_plane.normal for rig in rigs()])
    uniform = {
        "focal": np.log10([rig.camera.alpha / 600 for rig in rigs()]),
        "distance": np.log([distance(rig) / 100 for rig in rigs()]) / math.log(50),
        "inclination": (np.degrees(np.arcsin(normals[:, 2])) - 15) / 55,
        "roll": np.arctan2(normals[:, 1], normals[:, 0]) / (2 * math.pi) + 0.5,
    }
    for name, values in uniform.items():
        assert stats.kstest(values, "uniform").pvalue > ODDS, name
    assert {len(rig.target.positions) for rig in rigs()} == set(range(3, 10))


def test_all_stages_can_be_observed():
    for seed, rig in enumerate(rigs()):
        rng = np.random.default_rng(seed)
        seen = observed_rig(rig, 12, 8, 0.0, rng, crossing_views=8)
        ends = rig.camera.project(segments_in_sheet(rig, rig.target.length_mm / 2, 5, rng))
        for uv in (*(views.uv for views in seen.stages().values()), ends):
            assert (uv >= 0).all()
            assert (uv <= np.array(rig.camera.image_size) - 1).all()


def test_the_same_seed_gives_the_same_rig():
    one, two = (random_rig(np.random.default_rng(3)) for _ in range(2))
    assert one.camera == two.camera
    assert one.target == two.target
    assert np.array_equal(one.light_plane.normal, two.light_plane.normal)


def test_a_rig_without_room_is_drawn_again(monkeypatch):
    """A target of 40 m first, then one that fits."""
    fitting = paper_rig()
    too_long = paper_rig(target=CollinearTarget((0.0, 2e4, 4e4)))
    drawn = iter([too_long, fitting])
    monkeypatch.setattr(random_rigs, "_drawn_rig", lambda _: next(drawn))
    assert random_rig(np.random.default_rng(0)) is fitting
