"""Bent targets: parabolas through the ends, and the spots where sheets meet them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.bending import across, bent_targets
from sheetoflight.simulation.poses import PlacedTargets, Recording, placed_targets
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

BOW = 6.0


def straight_and_bent(roll: float) -> tuple[SimulatedRig, PlacedTargets, PlacedTargets]:
    rig = paper_rig(target=CollinearTarget((0.0, 100.0, 250.0, 400.0)))
    second = LightPlane(np.array([0.1, -0.85, 0.5]), 520.0, "second")
    rig = replace(rig, light_planes=(rig.light_plane, second))
    placed = placed_targets(rig, Recording(20, 20, 20), np.random.default_rng(0))
    stages = (placed.camera, placed.plane, placed.crossing)
    return rig, placed, bent_targets(rig, placed, *(BOW * across(p, roll) for p in stages))


def chord_coordinates(start: Array, end: Array, points: Array) -> tuple[Array, Array]:
    """Share along the chord, and distance from it, of one point for each chord."""
    length = np.linalg.norm(end - start, axis=-1)
    along = (end - start) / length[..., None]
    share = np.sum((points - start) * along, axis=-1) / length
    away = np.linalg.norm(points - start - (share * length)[..., None] * along, axis=-1)
    return share, away


def test_markers_lie_on_a_parabola_through_the_ends():
    rig, placed, bent = straight_and_bent(0.4)
    share = rig.target.positions / 400.0
    for stage in ("camera", "plane", "crossing"):
        before, after = getattr(placed, stage), getattr(bent, stage)
        bow = np.linalg.norm(after - before, axis=-1)
        assert bow == pytest.approx(np.broadcast_to(4 * share * (1 - share) * BOW, bow.shape))
        along = normalised(before[:, -1:] - before[:, :1])
        assert np.abs(np.sum((after - before) * along, axis=-1)).max() < 1e-9


def test_the_roll_is_counted_from_the_direction_towards_the_camera():
    """At 0 the bow lies in the plane of target and camera, nearer to it; at 90° square to it."""
    for roll, towards in ((0.0, True), (math.pi / 2, False)):
        _, placed, bent = straight_and_bent(roll)
        bow = (bent.camera - placed.camera)[:, 1]
        ends = placed.camera[:, [0, -1]]
        sight = normalised(np.cross(ends[:, 0], ends[:, 1]))
        middle = normalised(ends.mean(axis=1))
        out_of_plane = np.abs(np.sum(bow * sight, axis=1)) / np.linalg.norm(bow, axis=1)
        assert out_of_plane == pytest.approx(np.full(20, 0.0 if towards else 1.0), abs=1e-9)
        assert not towards or (np.sum(bow * middle, axis=1) < 0).all()


def test_spots_lie_on_the_sheet_and_on_the_parabola():
    rig, placed, bent = straight_and_bent(0.7)
    for laser, own in ((0, slice(0, 20)), (1, slice(20, 40))):
        plane, spots = rig.light_planes[laser], bent.spots[own, laser]
        share, away = chord_coordinates(bent.crossing[own, 0], bent.crossing[own, -1], spots)
        assert np.abs(spots @ plane.normal - plane.distance_mm).max() < 1e-9
        assert away == pytest.approx(4 * share * (1 - share) * BOW, abs=1e-9)
        assert np.abs(spots - placed.spots[own, laser]).max() > 0.1
        assert np.isnan(bent.spots[own, 1 - laser]).all()
