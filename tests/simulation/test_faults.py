"""Each fault does what it says, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation import detection_faults, faults
from sheetoflight.simulation.detection_faults import Stage
from sheetoflight.simulation.faults import FAULTS
from sheetoflight.simulation.poses import Recording, recorded
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, field_centre, paper_rig

RIG = paper_rig(target=CollinearTarget((0.0, 100.0, 250.0, 400.0)))
NOISY = Recording(12, 10, 8, pixel_std=0.1, placement_mm=0.2)
EXACT = Recording(12, 10, 8)
STAGES = get_args(Stage)
NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)


def seeded() -> np.random.Generator:
    return np.random.default_rng(1)


def changed(one: Observations, two: Observations, stage: str) -> np.ndarray:
    """Mask ``(N, M)`` of the image points that differ."""
    first, second = one.stages()[stage].uv, two.stages()[stage].uv
    close = np.isclose(first, second, rtol=0, atol=1e-9, equal_nan=True)
    return np.asarray(np.logical_not(close).any(axis=-1))


def lengths_in_sheet(plane: LightPlane, uv: Array) -> Array:
    """Distance of the first from the last marker, if they lie in the sheet."""
    ends = plane.intersect(RIG.camera.unproject(uv[:, [0, 3]]))
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)


def triangulated(uv: Array) -> Array:
    """Ends ``(N, 2, 3)`` of targets from exact image points, by their known positions alone:
    the depths are the null vector of ``(s_3 − s_1) z_0 r_0 − s_3 z_1 r_1 + s_1 z_3 r_3``."""
    rays, (_, s1, _, s3) = RIG.camera.unproject(uv[:, [0, 1, 3]]), RIG.target.positions
    depths = np.linalg.svd(np.swapaxes(rays * np.array([[s3 - s1], [-s3], [s1]]), 1, 2))[2][:, 2]
    ends = (depths[..., None] * rays)[:, [0, 2]]
    scale = 400.0 / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) * np.sign(depths[:, 0])
    return scale[:, None, None] * ends


# --- All of them ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_a_fault_changes_image_points_and_no_shape(name, seed):
    rig = RIG if seed is None else random_rig(np.random.default_rng(seed))
    seen, sound = FAULTS[name](rig, NOISY, seeded()), recorded(rig, NOISY, seeded())
    for stage, views in sound.stages().items():
        assert seen.stages()[stage].names == views.names
        assert np.array_equal(seen.stages()[stage].seen, views.seen)
    assert any(changed(seen, sound, stage).any() for stage in STAGES)


@pytest.mark.parametrize("name", FAULTS)
def test_the_same_seed_gives_the_same_observations(name):
    one, two = (FAULTS[name](RIG, NOISY, seeded()) for _ in range(2))
    assert not any(changed(one, two, stage).any() for stage in STAGES)


@pytest.mark.parametrize(
    "fault",
    [
        lambda rig, recording, rng: faults.bent_target(rig, recording, rng, bow_mm=0.0),
        lambda rig, recording, rng: faults.wrong_marker(rig, recording, rng, by_mm=0.0),
        lambda rig, recording, rng: faults.unmodelled_distortion(
            rig, recording, rng, NO_DISTORTION
        ),
        lambda rig, recording, rng: faults.defocus(rig, recording, rng, factor=1.0),
        lambda rig, recording, rng: faults.wrong_detections(
            rig, recording, rng, min_px=0, max_px=0
        ),
    ],
    ids=["bent", "marker", "distortion", "defocus", "detections"],
)
def test_a_fault_of_size_zero_is_none(fault):
    seen, sound = fault(RIG, NOISY, seeded()), recorded(RIG, NOISY, seeded())
    assert not any(changed(seen, sound, stage).any() for stage in STAGES)


# --- What the target and the rig do ---------------------------------------------------------------


def test_a_bent_target_keeps_its_ends():
    seen = faults.bent_target(RIG, NOISY, seeded(), bow_mm=3.0)
    moved = changed(seen, recorded(RIG, NOISY, seeded()), "camera")
    assert moved.tolist() == [[False, True, True, False]] * 12


def test_a_random_roll_differs_from_view_to_view():
    """The deviation from the chord points to either side of it."""
    uv = faults.bent_target(RIG, EXACT, seeded(), 3.0, roll_deg=None).camera.uv
    chord, bow = uv[:, 3] - uv[:, 0], uv[:, 1] - uv[:, 0]
    side = chord[:, 0] * bow[:, 1] - chord[:, 1] * bow[:, 0]
    assert side.min() < 0 < side.max()


@pytest.mark.parametrize("index", [0, 1, 2, 3, -1])
@pytest.mark.parametrize("stage", STAGES)
def test_a_wrong_marker_shows_in_the_cross_ratio(index, stage):
    """The cross ratio of four points on a line is the same in space and in the picture."""
    positions = RIG.target.positions.copy()
    positions[index] += 7.0
    uv = faults.wrong_marker(RIG, EXACT, seeded(), index, 7.0).stages()[stage].uv[:, :4]
    gap = {(i, j): np.linalg.norm(uv[:, i] - uv[:, j], axis=-1) for i in range(4) for j in range(4)}
    seen = gap[0, 2] * gap[1, 3] / (gap[1, 2] * gap[0, 3])
    a, b, c, d = positions
    assert seen == pytest.approx(np.full(len(uv), (c - a) * (d - b) / ((c - b) * (d - a))))


def test_a_wrong_marker_0_stays_the_fixed_point():
    uv = faults.wrong_marker(RIG, EXACT, seeded(), 0, 7.0).camera.uv[:, 0]
    assert uv == pytest.approx(np.broadcast_to(RIG.camera.project(RIG.anchor_mm), uv.shape))


@pytest.mark.parametrize(
    ("fault", "where", "slipped"),
    [
        (faults.slipped_pivot, 4, slice(4, None)),
        (faults.slipped_pivot, None, slice(6, None)),
        (faults.slipped_view, 3, slice(3, 4)),
    ],
)
def test_a_slipped_fixed_point_is_elsewhere_from_then_on(fault, where, slipped):
    seen = fault(RIG, EXACT, seeded(), where, [3.0, -2.0, 5.0])
    expected = np.tile(RIG.camera.project(RIG.anchor_mm), (12, 1))
    expected[slipped] = RIG.camera.project(RIG.anchor_mm + np.array([3.0, -2.0, 5.0]))
    assert seen.camera.uv[:, 0] == pytest.approx(expected)
    moved = changed(seen, recorded(RIG, EXACT, seeded()), "camera")
    assert np.flatnonzero(moved.any(axis=1)).tolist() == list(range(12))[slipped]


def test_an_unmodelled_lens_bends_what_the_told_one_keeps_straight():
    seen = faults.unmodelled_distortion(RIG, EXACT, seeded(), (-0.1, 0.02, 0.0, 0.0, 0.0))
    true = replace(RIG.camera, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
    for camera, straight in ((true, True), (RIG.camera, False)):
        rays = camera.unproject(seen.camera.uv)
        volume = np.linalg.det(rays[:, [0, 1, 3]])
        assert (np.abs(volume).max() < 1e-12) == straight


def test_a_moved_laser_lays_later_targets_into_another_sheet():
    plane = RIG.light_plane
    shifted = LightPlane(plane.normal, plane.distance_mm + 4.0)
    seen = faults.moved_laser(RIG, EXACT, seeded(), 4, turn_deg=0.0, shift_mm=4.0)
    assert lengths_in_sheet(plane, seen.plane.uv[:4]) == pytest.approx(np.full(4, 400.0))
    assert lengths_in_sheet(shifted, seen.plane.uv[4:]) == pytest.approx(np.full(6, 400.0))
    for stage, later in (("plane", 6), ("crossing", 4)):
        moved = changed(seen, recorded(RIG, EXACT, seeded()), stage).any(axis=1)
        assert moved.tolist() == [False] * 4 + [True] * later


def test_a_turned_laser_still_lights_the_middle_of_the_field():
    turned = faults.moved_laser(RIG, EXACT, seeded(), 0, turn_deg=1.0, shift_mm=0.0)
    points = triangulated(turned.plane.uv).reshape(-1, 3)
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    cosine = abs(normal @ RIG.light_plane.normal)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(1.0, abs=1e-4)
    assert normal @ (field_centre(RIG) - points.mean(axis=0)) == pytest.approx(0.0, abs=1e-4)


# --- Bounds ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "fault",
    [
        lambda rig: detection_faults.swapped_markers(rig, NOISY, seeded(), "crossing", 8),
        lambda rig: faults.slipped_view(rig, NOISY, seeded(), -1),
        lambda rig: faults.slipped_pivot(rig, NOISY, seeded(), 12),
        lambda rig: faults.moved_laser(rig, replace(NOISY, plane_views=0), seeded()),
    ],
    ids=["swapped", "view", "pivot", "laser"],
)
def test_a_view_that_is_not_there_is_refused(fault):
    with pytest.raises(InputError, match=r"has \d+ views, and none with number"):
        fault(RIG)


def test_a_rig_is_left_as_it_is():
    rig: SimulatedRig = replace(RIG, anchor_mm=RIG.anchor_mm.copy())
    before = rig.anchor_mm.copy(), rig.target, rig.light_planes, rig.camera
    for fault in FAULTS.values():
        fault(rig, NOISY, seeded())
    assert np.array_equal(rig.anchor_mm, before[0])
    assert (rig.target, rig.light_planes, rig.camera) == before[1:]
