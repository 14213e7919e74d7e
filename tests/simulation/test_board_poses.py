"""Random boards obey what was asked of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.board_poses import (
    BoardHolding,
    board_poses,
    board_rig,
    placed_points,
)
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.rig import SimulatedRig

BROWN = (-0.12, 0.05, 0.0008, -0.0006, 0.0)


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return board_rig(distortion=BROWN)


BOARDS = {
    "chessboard": PlanarBoard("chessboard", 11, 8, (20.0, 20.0)),
    "circles": PlanarBoard("circles", 4, 11, (15.0, 15.0), staggered=True),
    "folded": folded_body(),
}


@pytest.mark.parametrize("name", BOARDS)
def test_poses_are_rigid_and_show_every_point(rig, name):
    board, holding = BOARDS[name], BoardHolding(margin_px=25.0)
    rotations, translations = board_poses(rig, board, 40, np.random.default_rng(1), holding)
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, 1, 2), np.broadcast_to(np.eye(3), (40, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    uv = rig.camera.project(placed_points(board.points, rotations, translations))
    size = np.array(rig.camera.image_size) - 1.0
    assert uv.min() >= 25.0
    assert (size - uv).min() >= 25.0


def test_placed_points_are_turned_and_shifted():
    """About z by 90°: x becomes y, y becomes −x."""
    turn = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    placed = placed_points(np.array([[1.0, 2.0, 3.0]]), turn, np.array([[10.0, 20.0, 30.0]]))
    np.testing.assert_allclose(placed, [[[8.0, 21.0, 33.0]]])


def test_tilts_go_up_to_the_limit_in_all_directions(rig):
    """The angle between the line of sight to the board's middle and its third axis, and where
    that axis leans to, for boards that no sheet need cross. Of 300 tilts uniform over a disc,
    the chance that none is in the outer fifth (36 % of its area) of an eighth of it is 1e-6."""
    board = BOARDS["chessboard"]
    rotations, translations = board_poses(rig, board, 300, np.random.default_rng(2), laser=None)
    middle = placed_points(board.points, rotations, translations).mean(axis=1)
    sight = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    third = rotations[:, :, 2]
    tilt = np.degrees(np.arccos(np.sum(sight * third, axis=1)))
    assert tilt.max() <= 50.0 + 1e-9
    lean = third - np.sum(third * sight, axis=1, keepdims=True) * sight
    eighth = np.floor(np.arctan2(lean[:, 1], lean[:, 0]) / (np.pi / 4)).astype(int) % 8
    assert set(eighth[tilt > 40.0]) == set(range(8))


def test_boards_for_the_camera_alone_fill_the_picture_and_the_depth(rig):
    board = BOARDS["chessboard"]
    rotations, translations = board_poses(rig, board, 200, np.random.default_rng(3), laser=None)
    points = placed_points(board.points, rotations, translations)
    depth = points[..., 2].mean(axis=1)
    assert depth.min() < rig.depth_mm[0]
    assert depth.max() > rig.depth_mm[1]
    uv = rig.camera.project(points)
    width, height = rig.camera.image_size
    reached = {(int(4 * u / width), int(4 * v / height)) for u, v in uv.reshape(-1, 2)}
    assert len(reached) == 16


@pytest.mark.parametrize("laser", [0, 1])
def test_the_sheet_that_is_named_crosses_the_board(rig, laser):
    """Corners of the outline, one pitch beyond the points, lie on both sides of it, and its line
    is half as long as the longest side at least: found by 2 000 points of the outline."""
    second = LightPlane(np.array([-0.85, 0.1, 0.5]), 400.0, "second")
    both = replace(rig, light_planes=(*rig.light_planes, second))
    board = BOARDS["chessboard"]
    rotations, translations = board_poses(both, board, 30, np.random.default_rng(4), laser=laser)
    rectangle = np.array([(-20.0, -20.0), (220.0, -20.0), (220.0, 160.0), (-20.0, 160.0)])
    share = np.linspace(0.0, 1.0, 500)[:, None]
    edges = [a + share * (b - a) for a, b in zip(rectangle, np.roll(rectangle, -1, 0), strict=True)]
    outline = np.column_stack([np.concatenate(edges), np.zeros(2000)])
    placed = placed_points(outline, rotations, translations)
    sheet = both.light_planes[laser]
    above = placed @ sheet.normal - sheet.distance_mm
    for points, heights in zip(placed, above, strict=True):
        ends = points[np.flatnonzero((heights > 0) != (np.roll(heights, -1) > 0))]
        assert len(ends) == 2
        assert np.linalg.norm(ends[1] - ends[0]) > 0.5 * 240.0 - 1.0


def test_every_face_is_seen_and_lit(rig):
    """From the camera and from the projector, every face of the folded board shows its inner
    side: both are on the side of it on which the other face lies."""
    board = BOARDS["folded"]
    rotations, translations = board_poses(rig, board, 20, np.random.default_rng(5))
    points = placed_points(board.points, rotations, translations)
    for one, other in ((slice(25), slice(25, 50)), (slice(25, 50), slice(25))):
        for view in points:
            a, b, c = view[one][[0, 4, 20]]
            normal = np.cross(b - a, c - a)
            inner = float((view[other].mean(axis=0) - a) @ normal)
            for place in (np.zeros(3), rig.projector_mm):
                assert float((place - a) @ normal) * inner > 0


def test_the_whole_outline_can_be_asked_for(rig):
    holding = BoardHolding(whole=True, margin_px=5.0)
    poses = board_poses(
        rig, BOARDS["chessboard"], 30, np.random.default_rng(6), holding, laser=None
    )
    corners = np.array([(-20.0, -20.0, 0), (220.0, -20.0, 0), (220.0, 160.0, 0), (-20.0, 160.0, 0)])
    uv = rig.camera.project(placed_points(corners, *poses))
    assert uv.min() >= 5.0
    assert (np.array(rig.camera.image_size) - 1.0 - uv).min() >= 5.0


def test_the_roll_can_be_limited(rig):
    """The first axis leaves the plane of u and Z by the roll: its v component is the roll's sine,
    whatever the tilt."""
    holding = BoardHolding(max_roll_deg=10.0)
    limited, _ = board_poses(rig, rig.board, 30, np.random.default_rng(7), holding, laser=None)
    assert np.abs(limited[:, 1, 0]).max() <= np.sin(np.radians(10.0)) + 1e-12
    assert limited[:, 0, 0].min() > 0
    free, _ = board_poses(rig, rig.board, 30, np.random.default_rng(7), laser=None)
    assert (free[:, 0, 0] < 0).any()


def test_a_farthest_depth_is_kept(rig):
    holding = BoardHolding(farthest_mm=1000.0)
    poses = board_poses(rig, BOARDS["chessboard"], 30, np.random.default_rng(10), holding)
    assert placed_points(BOARDS["chessboard"].points, *poses)[..., 2].max() <= 1000.0


def test_a_board_that_does_not_fit_is_refused(rig):
    board = PlanarBoard("chessboard", 11, 8, (200.0, 200.0))
    with pytest.raises(InputError, match="0 of 3 board views"):
        board_poses(rig, board, 3, np.random.default_rng(8))


def test_none_is_none(rig):
    rotations, translations = board_poses(rig, rig.board, 0, np.random.default_rng(9))
    assert rotations.shape == (0, 3, 3)
    assert translations.shape == (0, 3)
