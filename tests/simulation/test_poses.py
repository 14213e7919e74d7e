"""Random targets obey the laws of their stage. Odds of failing by chance: 1e-6 a statistic."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import (
    Placement,
    Recording,
    crossing_poses,
    crossing_spots,
    in_plane_poses,
    lying_targets,
    observed,
    observed_rig,
    photographed,
    placed_targets,
    points_in_sheet,
    segments_in_sheet,
    target_points,
)
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

ODDS = 1e-6
SECOND = LightPlane(np.array([0.1, -0.85, 0.5]), 520.0, "second")
UNEVEN = CollinearTarget((0.0, 50.0, 170.0, 400.0))


def sheet(inclination_deg: float, roll_deg: float, z: float = 1100.0) -> LightPlane:
    """A sheet at an angle to the optical axis, which it meets at depth z."""
    tilt, roll = math.radians(inclination_deg), math.radians(roll_deg)
    normal = [math.cos(tilt) * math.cos(roll), math.cos(tilt) * math.sin(roll), math.sin(tilt)]
    return LightPlane(np.array(normal), z * math.sin(tilt))


def two_lasers() -> SimulatedRig:
    rig = paper_rig(target=UNEVEN)
    return replace(rig, light_planes=(rig.light_plane, SECOND))


def off(plane: LightPlane, points: Array) -> Array:
    return points @ plane.normal - plane.distance_mm


def in_frame(rig: SimulatedRig, points: Array, margin_px: float = 0.0) -> bool:
    uv, (width, height) = rig.camera.project(points), rig.camera.image_size
    corner = np.array([width, height]) - 1 - margin_px
    return bool((uv >= margin_px).all() and (uv <= corner).all())


def plausible_chi_square(squares: float, freedom: int) -> bool:
    low, high = stats.chi2.ppf([ODDS / 2, 1 - ODDS / 2], freedom)
    return bool(low < squares < high)


# --- Points of a sheet ----------------------------------------------------------------------------


@given(st.floats(15, 70), st.sampled_from([0, 90, 180, 270]) | st.floats(0, 360))
def test_points_lie_in_any_sheet_with_uniform_depth(inclination, roll):
    rig = replace(paper_rig(), light_planes=(sheet(inclination, roll),))
    points = points_in_sheet(rig, 400, np.random.default_rng(0))
    assert np.abs(off(rig.light_plane, points)).max() < 1e-9
    depth = (points[:, 2] - 900.0) / 400.0
    assert stats.kstest(depth, "uniform").pvalue > ODDS


@pytest.mark.parametrize("roll", [0.0, 37.0, 90.0, 200.0])
def test_every_seen_part_of_a_sheet_is_reached(roll):
    """Pixels that see the sheet in the depth range: each of 8 × 8 fields of them gets points.

    The emptiest field holds some 1/2000 of what is drawn; none in 50 000 has odds of 1e-10.
    """
    rig = replace(paper_rig(), light_planes=(sheet(60.0, roll),))
    width, height = rig.camera.image_size
    u, v = np.meshgrid((np.arange(8) + 0.5) * width / 8, (np.arange(8) + 0.5) * height / 8)
    seen = rig.light_plane.intersect(rig.camera.unproject(np.stack([u, v], axis=-1)))[..., 2]
    expected = (seen > 900.0) & (seen < 1300.0)
    uv = rig.camera.project(points_in_sheet(rig, 50_000, np.random.default_rng(0)))
    counts = np.histogram2d(uv[:, 1], uv[:, 0], bins=8, range=[(0, height), (0, width)])[0]
    assert expected.any()
    assert (counts[expected] > 0).all()


# --- Targets --------------------------------------------------------------------------------------


@pytest.mark.parametrize("laser", [0, 1])
def test_in_plane_targets_and_segments_lie_in_the_sheet_of_their_laser(laser):
    rig, rng = two_lasers(), np.random.default_rng(1)
    plane = rig.light_planes[laser]
    poses = in_plane_poses(rig, 40, rng, margin_px=20.0, laser=laser)
    points = target_points(*poses, rig.target.positions)
    ends = segments_in_sheet(rig, 150.0, 40, rng, margin_px=20.0, laser=laser)
    for lying in (points, ends):
        assert np.abs(off(plane, lying)).max() < 1e-9
        assert in_frame(rig, lying, 20.0)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(150.0)


@pytest.mark.parametrize("laser", [0, 1])
def test_a_spot_lies_on_the_sheet_and_on_the_target(laser):
    rig = two_lasers()
    plane = rig.light_planes[laser]
    origins, directions = crossing_poses(rig, 300, np.random.default_rng(2), 15.0, laser)
    spots = crossing_spots(plane, origins, directions)
    share = np.sum((spots - origins) * directions, axis=1) / 400.0
    angle = np.degrees(np.arcsin(np.abs(directions @ plane.normal)))
    assert np.abs(off(plane, spots)).max() < 1e-8
    assert np.abs(np.cross(spots - origins, directions)).max() < 1e-8
    assert share.min() > 0.05 - 1e-12
    assert share.max() < 0.95 + 1e-12
    assert angle.min() >= 15.0 - 1e-9
    assert spots[:, 2].min() > 900.0
    assert spots[:, 2].max() < 1300.0
    assert in_frame(rig, spots, 15.0)
    assert in_frame(rig, target_points(origins, directions, rig.target.positions), 15.0)


def test_crossing_targets_come_from_both_sides_and_all_along():
    """Every tenth of the target between its limits is met, from either side."""
    rig = paper_rig()
    origins, directions = crossing_poses(rig, 2000, np.random.default_rng(3))
    side = directions @ rig.light_plane.normal
    along = (rig.light_plane.distance_mm - origins @ rig.light_plane.normal) / side / 400.0
    assert (np.histogram(along, bins=9, range=(0.05, 0.95))[0] > 0).all()
    assert side.min() < 0 < side.max()


def test_a_sheet_out_of_view_is_an_error():
    rig = replace(paper_rig(), light_planes=(LightPlane(np.array([1.0, 0.0, 0.0]), 5000.0),))
    with pytest.raises(InputError, match="only 0 of 3 crossing views"):
        crossing_poses(rig, 3, np.random.default_rng(0))


# --- Placement ------------------------------------------------------------------------------------


def displaced(placement: Placement, count: int = 2000) -> tuple[SimulatedRig, Array]:
    rig = paper_rig(target=UNEVEN)
    recording = Recording(0, count, placement_mm=0.3, placement=placement)
    return rig, lying_targets(rig, recording, np.random.default_rng(4))


def test_the_ends_of_a_placed_rod_are_off_by_the_stated_std():
    rig, points = displaced("rod")
    ends = off(rig.light_plane, points[:, [0, -1]])
    for end in ends.T:
        assert plausible_chi_square(float((end**2).sum()) / 0.3**2, len(end))
    correlation = float(np.asarray(np.corrcoef(ends.T))[0, 1])
    assert abs(correlation) * math.sqrt(len(ends)) < -stats.norm.ppf(ODDS / 2)


def test_a_placed_rod_stays_straight_and_keeps_its_length():
    _, points = displaced("rod")
    from_first = points - points[:, :1]
    assert np.linalg.norm(from_first, axis=-1) == pytest.approx(
        np.broadcast_to(UNEVEN.positions, points.shape[:2]), abs=1e-9
    )
    assert np.abs(np.cross(from_first[:, 1:], from_first[:, -1:])).max() < 1e-6


def test_single_markers_are_off_by_the_stated_std_along_the_normal():
    rig, points = displaced("markers")
    away = off(rig.light_plane, points)
    foot = points - away[..., None] * rig.light_plane.normal
    assert plausible_chi_square(float((away**2).sum()) / 0.3**2, away.size)
    correlations = np.asarray(np.corrcoef(away.T))[np.triu_indices(4, 1)]
    assert np.abs(np.sqrt(len(away)) * correlations).max() < -stats.norm.ppf(ODDS / 2 / 6)
    assert np.linalg.norm(foot - foot[:, :1], axis=-1) == pytest.approx(
        np.broadcast_to(UNEVEN.positions, away.shape), abs=1e-9
    )


def test_a_target_far_off_the_sheet_is_refused():
    with pytest.raises(InputError, match="keep placement_mm below 40"):
        observed_rig(paper_rig(), 3, 3, 0.1, np.random.default_rng(0), placement_mm=41.0)


@pytest.mark.parametrize("wrong", [{"camera_views": -1}, {"pixel_std": -0.1}])
def test_negative_recordings_are_refused(wrong):
    with pytest.raises(InputError, match="give 0 or more"):
        replace(Recording(3, 3), **wrong)


def test_an_unknown_placement_is_refused():
    with pytest.raises(InputError, match=r"placement is 'ends'.*choose rod \| markers"):
        Recording(3, 3, placement="ends")  # pyright: ignore[reportArgumentType] – refused


# --- Observations ---------------------------------------------------------------------------------


def test_counts_are_for_each_laser_and_names_are_unique():
    seen = observed_rig(two_lasers(), 5, 3, 0.1, np.random.default_rng(5), crossing_views=2)
    assert (len(seen.camera), len(seen.plane), len(seen.crossing)) == (5, 6, 4)
    assert seen.plane.lasers.tolist() == [0, 0, 0, 1, 1, 1]
    assert all(len(set(views.names)) == len(views) for views in seen.stages().values())


def test_crossing_views_show_the_spot_of_their_laser_alone():
    rig, recording = two_lasers(), Recording(0, 0, 3)
    placed = placed_targets(rig, recording, np.random.default_rng(6))
    views = photographed(rig.camera, placed, 0.0, np.random.default_rng(0)).crossing
    assert views.uv.shape == (6, 4 + 2, 2)
    assert views.seen[:, 4:].tolist() == [[True, False]] * 3 + [[False, True]] * 3
    for laser, own in ((0, slice(0, 3)), (1, slice(3, 6))):
        spots = placed.spots[own, laser]
        along = placed.crossing[own, -1] - placed.crossing[own, 0]
        assert np.abs(off(rig.light_planes[laser], spots)).max() < 1e-8
        assert np.abs(np.cross(spots - placed.crossing[own, 0], along)).max() < 1e-6
        assert views.uv[own, 4 + laser] == pytest.approx(rig.camera.project(spots))


def test_noise_has_the_stated_std_in_every_stage():
    rig, recording = two_lasers(), Recording(100, 100, 100, pixel_std=0.2)
    placed = placed_targets(rig, recording, np.random.default_rng(7))
    true = photographed(rig.camera, placed, 0.0, np.random.default_rng(0))
    seen = photographed(rig.camera, placed, 0.2, np.random.default_rng(8))
    for stage, views in seen.stages().items():
        errors = views.uv - true.stages()[stage].uv
        errors = errors[np.isfinite(errors)]
        assert plausible_chi_square(float((errors**2).sum()) / 0.2**2, errors.size)


def test_the_number_of_the_laser_is_handed_on():
    rig = paper_rig()
    points = target_points(*in_plane_poses(rig, 2, np.random.default_rng(9)), rig.target.positions)
    views = observed(rig.camera, points, 0.1, np.random.default_rng(0), laser=np.array([1, 0]))
    assert views.lasers.tolist() == [1, 0]


def test_a_placement_and_crossings_leave_the_targets_of_other_stages():
    """Views of stage camera are the same targets however the others are recorded."""
    plain, full = (
        placed_targets(paper_rig(), recording, np.random.default_rng(10))
        for recording in (Recording(8, 4), Recording(8, 4, 5, 0.1, 0.3, "markers"))
    )
    assert np.array_equal(plain.camera, full.camera)
    assert np.abs(plain.plane - full.plane).max() < 0.3 * 6.0
