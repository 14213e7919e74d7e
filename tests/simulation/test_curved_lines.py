"""Lines of curved sheets and of true cones on boards."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import curvature_about
from sheetoflight.simulation.bending import bent_targets
from sheetoflight.simulation.board_faults import bent_boards
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import observed_boards, placed_boards
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.curved_lines import spots_of_light
from sheetoflight.simulation.degenerate import with_sheet_at
from sheetoflight.simulation.light_cone import LightCone, touching_sheet
from sheetoflight.simulation.poses import (
    Recording,
    crossing_poses,
    in_plane_poses,
    placed_targets,
    points_in_sheet,
    segments_in_sheet,
)
from sheetoflight.simulation.render import RenderOptions, brightness
from sheetoflight.simulation.rig import SimulatedRig, field_centre
from sheetoflight.simulation.scene import Scene, wall_surface
from sheetoflight.simulation.views import folder_truth, picture_tasks

BOARD = PlanarBoard("chessboard", 11, 8, (20.0, 20.0))
VIEWS = 8
PER_MM = np.array([6e-5, 1e-5, -4e-5])
FLAT = board_rig(BOARD)


def rng():
    return np.random.default_rng(6)


def curved_rig() -> SimulatedRig:
    plane = FLAT.light_plane
    bend = curvature_about(plane.normal, field_centre(FLAT), PER_MM)
    return replace(FLAT, light_planes=(replace(plane, curvature=bend),))


def the_cone() -> LightCone:
    """Its apex is the projector; the light runs near the paper's sheet, 1.5° from flat."""
    half = math.radians(88.5)
    away = field_centre(FLAT) - FLAT.projector_mm
    away /= np.linalg.norm(away)
    axis = math.cos(half) * away - math.sin(half) * FLAT.light_plane.normal
    return LightCone(FLAT.projector_mm, axis, half)


def cone_rig() -> SimulatedRig:
    cone = the_cone()
    sheet = touching_sheet(cone, field_centre(FLAT))
    return replace(FLAT, light_planes=(sheet,), cones=(cone,))


Poses = tuple[Array, Array]


@pytest.fixture(scope="module")
def poses() -> Poses:
    return board_poses(FLAT, BOARD, VIEWS, rng())


def angle_to_axis(cone: LightCone, points: np.ndarray) -> np.ndarray:
    away = points - cone.apex
    off = np.linalg.norm(np.cross(away, cone.axis), axis=1)
    return np.arctan2(off, away @ cone.axis)


def test_a_cone_is_where_its_generators_are():
    cone = the_cone()
    across = np.cross(cone.axis, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    other = np.cross(cone.axis, across)
    turn = np.linspace(0.0, 6.0, 13)[:, None]
    spread = np.cos(turn) * across + np.sin(turn) * other
    light = math.cos(cone.half_angle) * cone.axis + math.sin(cone.half_angle) * spread
    for far in (1.0, 300.0, 2000.0):
        on = cone.apex + far * light
        assert np.abs(cone.heights(on)).max() < 1e-9
        outward = cone.gradients(on)
        np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0)
        assert np.abs(np.sum(outward * light, axis=1)).max() < 1e-12
        np.testing.assert_allclose(cone.heights(on + 2.5 * outward), 2.5)


def test_an_obtuse_cone_is_refused():
    with pytest.raises(InputError, match="half angle"):
        LightCone(np.zeros(3), np.array([0.0, 0.0, 1.0]), math.pi / 2)


def test_the_touching_sheet_leaves_the_cone_with_the_third_power_of_the_distance():
    """Place, slope and curvature are the cone's: what is left grows by 8 for each doubling."""
    cone, near = the_cone(), field_centre(FLAT)
    sheet = touching_sheet(cone, near)
    bend = sheet.curvature
    assert bend is not None
    start = bend.centre
    assert abs(cone.heights(start)) < 1e-9
    direction = np.random.default_rng(9).normal(size=(20, 3)) @ bend.axes @ bend.axes.T
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    off = []
    for far in (20.0, 40.0, 80.0):
        on_plane = start + far * direction
        points = on_plane + bend.heights(on_plane)[:, None] * sheet.normal
        assert np.abs(sheet.heights(points)).max() < 1e-9
        off.append(np.abs(cone.heights(points)).max())
    np.testing.assert_allclose(np.divide(off[1:], off[:-1]), 8.0, rtol=0.25)
    flat = np.abs(cone.heights(start + 80.0 * direction)).max()
    assert off[-1] < 0.2 * flat


@pytest.mark.parametrize("make", [curved_rig, cone_rig], ids=["quadratic", "cone"])
def test_lines_lie_on_the_board_and_in_the_sheet(make, poses: Poses):
    rig, (rotations, shifts) = make(), poses
    line = placed_boards(rig, BOARD, rotations, shifts, 200).line
    on_board = np.einsum("nji,nj->ni", rotations[line.view], line.points - shifts[line.view])
    assert np.abs(on_board[:, 2]).max() < 1e-9
    low, high = [-20.0, -20.0], [220.0, 160.0]
    assert ((on_board[:, :2] >= low) & (on_board[:, :2] <= high)).all()
    if rig.cones:
        off = angle_to_axis(the_cone(), line.points) - the_cone().half_angle
        assert np.abs(off).max() < 1e-12
    else:
        bend = rig.light_plane.curvature
        assert bend is not None
        x, y = bend.axes.T @ (line.points - bend.centre).T
        expected = 0.5 * (PER_MM[0] * x**2 + 2 * PER_MM[1] * x * y + PER_MM[2] * y**2)
        above = line.points @ rig.light_plane.normal - rig.light_plane.distance_mm
        np.testing.assert_allclose(above, expected, atol=1e-9)
        assert np.ptp(above) > 0.1
    counts = np.bincount(line.view, minlength=VIEWS)
    assert (counts > 150).all()


@pytest.mark.parametrize("make", [curved_rig, cone_rig], ids=["quadratic", "cone"])
def test_along_is_the_way_to_the_next_point(make, poses: Poses):
    line = placed_boards(make(), BOARD, *poses, line_points=400).line
    for view in range(VIEWS):
        own = line.take(line.view == view)
        step = own.points[2:] - own.points[:-2]
        step /= np.linalg.norm(step, axis=1, keepdims=True)
        cosine = np.abs(np.sum(step * own.along[1:-1], axis=1))
        assert cosine.min() > 1.0 - 1e-6


def test_flat_sheets_are_left_as_they_were(poses: Poses):
    """A curvature that is next to nothing gives the flat sheet's line, point by point."""
    rig = curved_rig()
    bend = rig.light_plane.curvature
    assert bend is not None
    tiny = replace(rig.light_plane, curvature=replace(bend, per_mm=1e-9 * PER_MM))
    line = placed_boards(replace(rig, light_planes=(tiny,)), BOARD, *poses, line_points=100).line
    flat = placed_boards(FLAT, BOARD, *poses, line_points=100).line
    np.testing.assert_allclose(line.points, flat.points, atol=1e-6)


def test_noise_is_across_the_curve(poses: Poses):
    clean = observed_boards(cone_rig(), BOARD, *poses, rng(), line_points=500).line
    noisy = observed_boards(cone_rig(), BOARD, *poses, rng(), line_std=0.2, line_points=500).line
    off = noisy.uv - clean.uv
    size = np.linalg.norm(off, axis=1)
    assert stats.kstest(size / 0.2, stats.halfnorm.cdf).pvalue > 1e-4
    way = np.gradient(clean.uv[clean.view == 0], axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    shifts = off[clean.view == 0]
    assert np.abs(np.sum(shifts * way, axis=1)).max() < 0.02 * np.abs(shifts).max()


def test_faces_of_a_body_carry_their_own_curves():
    body = folded_body()
    rig = replace(cone_rig(), board=body)
    rotations, shifts = board_poses(FLAT, body, 4, rng())
    line = placed_boards(rig, body, rotations, shifts, 200).line
    off = angle_to_axis(the_cone(), line.points) - the_cone().half_angle
    assert np.abs(off).max() < 1e-12
    placed = np.einsum("nji,nj->ni", rotations[line.view], line.points - shifts[line.view])
    faces = body.faces[line.face]
    assert np.abs(np.sum(placed * faces[:, :3], axis=1) - faces[:, 3]).max() < 1e-9
    assert set(line.face) == {0, 1}


def test_two_lasers_may_be_flat_and_curved(poses: Poses):
    cone = cone_rig()
    other = LightPlane(np.array([0.91, -0.05, 0.41]), 560.0, "second")
    rig = replace(cone, light_planes=(*cone.light_planes, other), cones=(*cone.cones, None))
    assert (rig.is_flat(0), rig.is_flat(1)) == (False, True)
    line = placed_boards(rig, BOARD, *poses, line_points=50).line
    assert np.abs(rig.heights(line.points, line.laser)).max() < 1e-9
    assert set(line.laser) == {0, 1}
    with pytest.raises(InputError, match="2 sheets of light have 1 cones"):
        replace(rig, cones=cone.cones)


def test_a_bent_board_carries_the_curved_line(poses: Poses):
    rig = curved_rig()
    placed = bent_boards(rig, BOARD, placed_boards(rig, BOARD, *poses, line_points=100), 3.0)
    assert np.abs(rig.heights(placed.line.points, placed.line.laser)).max() < 1e-6


@pytest.mark.parametrize("make", [curved_rig, cone_rig], ids=["quadratic", "cone"])
def test_rods_are_crossed_on_the_surface(make):
    rig = make()
    origins, directions = crossing_poses(rig, 20, rng())
    spots = spots_of_light(rig, 0, origins, directions)
    assert np.abs(rig.surface(0).heights(spots)).max() < 1e-9
    assert np.linalg.norm(np.cross(spots - origins, directions), axis=1).max() < 1e-9
    placed = placed_targets(rig, Recording(2, 0, 5), rng())
    assert np.abs(rig.surface(0).heights(placed.spots[:, 0])).max() < 1e-9


def test_points_in_a_curved_sheet_lie_in_it():
    rig = curved_rig()
    assert np.abs(rig.light_plane.heights(points_in_sheet(rig, 50, rng()))).max() < 1e-9


@pytest.mark.parametrize("make", [curved_rig, cone_rig], ids=["quadratic", "cone"])
def test_what_needs_a_flat_sheet_is_refused(make):
    rig, bows = make(), np.zeros((5, 3))
    placed = placed_targets(rig, Recording(2, 0, 5), rng())
    calls = (
        lambda: in_plane_poses(rig, 1, rng()),
        lambda: segments_in_sheet(rig, 100.0, 1, rng()),
        lambda: with_sheet_at(rig, 10.0),
        lambda: bent_targets(rig, placed, bows[:2], bows[:0], bows),
    )
    for call in calls:
        with pytest.raises(InputError, match="'laser' is curved"):
            call()


def strongly_curved(rig: SimulatedRig) -> SimulatedRig:
    plane = rig.light_plane
    bend = curvature_about(plane.normal, field_centre(rig), np.array([4e-4, 1e-4, 3e-4]))
    return replace(rig, light_planes=(replace(plane, curvature=bend),))


def test_pictures_show_the_curve(small_rig):
    """On a wall, the light's centre in each row is where the wall's curve is, found here point by
    point with bisection; the plane's own line is pixels away."""
    rig, wall = strongly_curved(small_rig), wall_surface(small_rig, 1100.0)
    options = RenderOptions(ambient_level=0.0, vignetting=0.0, defocus_px=0.7, sheet_sigma_mm=1.0)
    picture = brightness(rig, Scene((wall,)), options, laser=True)
    columns = np.arange(320.0)
    normal, distance = wall.plane
    off, flat_off = [], []
    for row in range(20, 221, 20):
        seen = picture[row] @ columns / picture[row].sum()
        for found, sheet in ((off, rig.light_plane), (flat_off, small_rig.light_plane)):
            low, high = 0.0, 319.0

            def height(u: float, sheet: LightPlane = sheet, row: int = row) -> float:
                ray = rig.camera.unproject(np.array([u, float(row)]))
                return float(sheet.heights(distance / (ray @ normal) * ray))

            for _ in range(50):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if height(middle) > 0 else (middle, high)
            found.append(seen - low)
    assert np.abs(off).max() < 0.05
    assert np.abs(flat_off).max() > 1.0


def test_the_truth_of_a_board_picture_is_the_curves(small_rig):
    rig = strongly_curved(replace(small_rig, board=PlanarBoard("chessboard", 6, 5, (14.0, 12.0))))
    tasks = picture_tasks(rig, 0, 0, board_views=3, seed=3)
    ends = np.concatenate([t.truth["line_xyz"] for t in tasks if t.stage == "board"])
    assert np.abs(rig.light_plane.heights(ends)).max() < 1e-9
    assert np.abs(small_rig.light_plane.heights(ends)).max() > 0.05


def test_the_truth_of_a_folder_says_the_curvature(small_rig):
    rig = strongly_curved(small_rig)
    bend = rig.light_plane.curvature
    assert bend is not None
    said = folder_truth(rig, ())["light_plane"]["curvature"]
    assert said["per_mm"] == bend.per_mm.tolist()
    assert np.shape(said["axes"]) == (3, 2)
    assert "curvature" not in folder_truth(small_rig, ())["light_plane"]
