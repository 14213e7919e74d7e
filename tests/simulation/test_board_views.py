"""Observed boards against OpenCV's projection and the geometry of planes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy import stats

from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.board_faults import (
    bent_boards,
    lines_beyond,
    scaled_board,
    shifted_lines,
)
from sheetoflight.simulation.board_lines import chords, face_outlines
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import (
    observed_boards,
    photographed_boards,
    placed_boards,
)
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.rig import SimulatedRig

BROWN = (-0.12, 0.05, 0.0008, -0.0006, 0.01)
VIEWS = 12
Poses = tuple[Array, Array]
BOARD = PlanarBoard("chessboard", 11, 8, (20.0, 20.0))
RECTANGLE = (-20.0, 220.0, -20.0, 160.0)
"""The chessboard's outline, one pitch beyond its corners."""


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return board_rig(distortion=BROWN)


@pytest.fixture(scope="module")
def poses(rig) -> Poses:
    return board_poses(rig, BOARD, VIEWS, np.random.default_rng(1))


@pytest.fixture
def rng():
    return np.random.default_rng(2)


def rays(rig, uv):
    """Normalised coordinates of image points by OpenCV's own inverse of the lens."""
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    camera = rig.camera
    undistorted = cv2.undistortPoints(
        uv[:, None], camera.matrix, np.array(camera.distortion), criteria=criteria
    )
    return np.column_stack([undistorted[:, 0], np.ones(len(uv))])


def on_board(rig, pose, uv, plane=(0.0, 0.0, 1.0, 0.0)):
    """Where rays through image points meet a plane of the board's frame: in that frame, mm, and
    in the camera's."""
    rotation, shift = pose
    normal = rotation @ np.array(plane[:3])
    directions = rays(rig, uv)
    reach = (plane[3] + normal @ shift) / (directions @ normal)
    points = reach[:, None] * directions
    return (points - shift) @ rotation, points


def test_corners_are_where_opencv_projects_them(rig, poses: Poses, rng):
    views = observed_boards(rig, BOARD, *poses, rng)
    assert np.isnan(views.stds).all()
    for uv, rotation, shift in zip(views.uv, *poses, strict=True):
        expected, _ = cv2.projectPoints(
            BOARD.points,
            cv2.Rodrigues(rotation)[0],
            shift,
            rig.camera.matrix,
            np.array(rig.camera.distortion),
        )
        np.testing.assert_allclose(uv, expected[:, 0], atol=1e-9)


def test_corners_are_noisy_as_told(rig, poses: Poses, rng):
    """Both coordinates of 1 056 corners against the normal law; fails once in 1e6 by chance."""
    views = observed_boards(rig, BOARD, *poses, rng, pixel_std=0.3)
    still = observed_boards(rig, BOARD, *poses, rng)
    assert stats.kstest((views.uv - still.uv).ravel() / 0.3, "norm").pvalue > 1e-6
    np.testing.assert_array_equal(views.stds, 0.3)


def test_the_line_lies_in_the_sheet_and_on_the_board(rig, poses: Poses, rng):
    """Each pixel's ray is met with the board: the point is one of the sheet, and within the
    outline; the first and last point lie half a step from the rim; the steps are even in the
    undistorted picture."""
    line = observed_boards(rig, BOARD, *poses, rng, line_points=200).line
    sheet = rig.light_plane
    for view in range(VIEWS):
        uv = line.uv[line.view == view]
        assert len(uv) == 200
        at, points = on_board(rig, (poses[0][view], poses[1][view]), uv)
        np.testing.assert_allclose(points @ sheet.normal, sheet.distance_mm, atol=1e-6)
        left, right, top, bottom = RECTANGLE
        to_rim = np.min([at[:, 0] - left, right - at[:, 0], at[:, 1] - top, bottom - at[:, 1]], 0)
        assert to_rim.min() > 0
        step = np.linalg.norm(np.diff(at, axis=0), axis=1)
        assert to_rim[0] <= 0.51 * step[0]
        assert to_rim[-1] <= 0.51 * step[-1]
        even = np.linalg.norm(np.diff(rays(rig, uv), axis=0), axis=1)
        np.testing.assert_allclose(even, even.mean(), rtol=1e-5)
    assert not line.face.any()
    assert not line.laser.any()


def test_the_line_is_noisy_across_itself_only(rig, poses: Poses, rng):
    """Displacements along the line's picture are 0; across it they follow the normal law, which
    fails once in 1e6 by chance. The directions come from differences of neighbouring points."""
    still = observed_boards(rig, BOARD, *poses, rng).line
    noisy = observed_boards(rig, BOARD, *poses, rng, line_std=0.25).line
    np.testing.assert_array_equal(noisy.std, 0.25)
    assert np.isnan(still.std).all()
    across = []
    for view in range(VIEWS):
        mine = still.view == view
        along = np.gradient(still.uv[mine], axis=0)[1:-1]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        moved = (noisy.uv - still.uv)[mine][1:-1]
        assert np.abs(np.sum(moved * along, axis=1)).max() < 1e-4
        across.append(moved[:, 1] * along[:, 0] - moved[:, 0] * along[:, 1])
    assert stats.kstest(np.concatenate(across) / 0.25, "norm").pvalue > 1e-6


def test_lines_of_a_body_lie_on_the_face_they_name(rig, rng):
    body = folded_body()
    poses: Poses = board_poses(rig, body, 8, rng)
    views = observed_boards(rig, body, *poses, rng, line_points=300)
    assert views.uv.shape == (8, 50, 2)
    faces = {(int(v), int(f)) for v, f in zip(views.line.view, views.line.face, strict=True)}
    assert {f for _, f in faces} == {0, 1}
    for view, face in faces:
        uv = views.line.uv[(views.line.view == view) & (views.line.face == face)]
        at, points = on_board(rig, (poses[0][view], poses[1][view]), uv, body.faces[face])
        sheet = rig.light_plane
        np.testing.assert_allclose(points @ sheet.normal, sheet.distance_mm, atol=1e-6)
        sign = 1.0 if face == 0 else -1.0
        assert (sign * at[:, 0] > 0).all()
        assert ((at[:, 1] > 0) & (at[:, 1] < 100.0)).all()


def test_every_laser_draws_its_own_line(rig, poses: Poses, rng):
    second = LightPlane(rig.light_plane.normal, rig.light_plane.distance_mm + 4.0, "second")
    both = replace(rig, light_planes=(*rig.light_planes, second))
    line = observed_boards(both, BOARD, *poses, rng, line_points=50).line
    for number, sheet in enumerate(both.light_planes):
        for view in range(VIEWS):
            mine = (line.view == view) & (line.laser == number)
            _, points = on_board(both, (poses[0][view], poses[1][view]), line.uv[mine])
            assert mine.sum() == 50
            np.testing.assert_allclose(points @ sheet.normal, sheet.distance_mm, atol=1e-6)


def test_only_lit_views_have_a_line(rig, poses: Poses, rng):
    lit = np.arange(VIEWS)[:, None] % 3 == 0
    line = observed_boards(rig, BOARD, *poses, rng, line_points=50, lit=lit).line
    assert set(line.view) == {0, 3, 6, 9}
    dark = observed_boards(rig, BOARD, *poses, rng, lit=np.zeros((VIEWS, 1), dtype=bool))
    assert len(dark.line) == 0


def test_what_leaves_the_picture_is_no_line(rig, rng):
    """A board held to the lower edge: its line's pixels are all in the picture, and fewer."""
    rotation = np.eye(3)[None]
    z = 1000.0
    sheet = rig.light_plane
    x = (sheet.distance_mm - sheet.normal[2] * z) / sheet.normal[0]
    views = observed_boards(rig, BOARD, rotation, np.array([[x - 80.0, 70.0, z]]), rng)
    assert 0 < len(views.line) < 1000
    assert views.line.uv[:, 1].max() <= rig.camera.image_size[1] - 1
    assert np.nanmax(views.uv[..., 1]) < rig.camera.image_size[1]


def test_a_sheet_that_misses_a_face_draws_nothing_on_it():
    square = np.array([[(0.0, 0, 5), (1.0, 0, 5), (1.0, 1, 5), (0.0, 1, 5)]])
    assert np.isnan(chords(square, LightPlane(np.array([1.0, 0.0, 0.0]), 2.0))).all()
    ends = chords(square, LightPlane(np.array([1.0, 0.0, 0.0]), 0.25))[0]
    np.testing.assert_allclose(np.sort(ends, axis=0), [(0.25, 0, 5), (0.25, 1, 5)])


def test_outline_of_a_body_is_its_hull():
    """Named in any order and with points inside, a face has its four corners, in order."""
    body = folded_body()
    first, _ = face_outlines(body)
    assert len(first) == 4
    sides = np.linalg.norm(np.roll(first, -1, axis=0) - first, axis=1)
    np.testing.assert_allclose(sides, 100.0)


def test_names_and_same_seed(rig, poses: Poses):
    one, two = (
        observed_boards(rig, BOARD, *poses, np.random.default_rng(7), 0.1, 0.2) for _ in range(2)
    )
    assert one.names[:2] == ("board00", "board01")
    np.testing.assert_array_equal(one.uv, two.uv)
    np.testing.assert_array_equal(one.line.uv, two.line.uv)


# --- Faults ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn_deg", [0.0, 70.0])
def test_a_bent_board_is_a_parabola_in_the_sheet(rig, poses: Poses, turn_deg):
    """Its outermost points stay, its middle lies `bow_mm` behind; the line is on both surfaces."""
    placed = placed_boards(rig, BOARD, *poses, line_points=60)
    bent = bent_boards(rig, BOARD, placed, 3.0, turn_deg)
    in_frame = np.einsum("nmi,nij->nmj", bent.points - poses[1][:, None], poses[0])
    np.testing.assert_allclose(
        in_frame[..., :2], BOARD.points[None, :, :2].repeat(VIEWS, 0), atol=1e-9
    )
    height = in_frame[..., 2]
    assert height.min() == pytest.approx(0.0, abs=1e-9)
    middle = BOARD.points[:, :2].mean(axis=0)
    direction = np.array([np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))])
    reach = np.abs((BOARD.points[:, :2] - middle) @ direction).max()

    def parabola(xy):
        return 3.0 * (1.0 - ((xy - middle) @ direction / reach) ** 2)

    np.testing.assert_allclose(height[0], parabola(BOARD.points[:, :2]), atol=1e-9)
    sheet, line = rig.light_plane, bent.line
    np.testing.assert_allclose(line.points @ sheet.normal, sheet.distance_mm, atol=1e-8)
    at = np.einsum("ni,nij->nj", line.points - poses[1][line.view], poses[0][line.view])
    np.testing.assert_allclose(at[:, 2], parabola(at[:, :2]), atol=1e-8)
    assert np.abs(line.points - placed.line.points).max() > 1.0


def test_shifted_lines_stay_on_the_board(rig, poses: Poses, rng):
    """By the distance of the view, at right angles to the line as it was."""
    offsets = np.linspace(-2.0, 2.0, VIEWS)
    placed = placed_boards(rig, BOARD, *poses, line_points=20)
    moved = shifted_lines(BOARD, placed, offsets)
    shift = moved.line.points - placed.line.points
    np.testing.assert_allclose(
        np.linalg.norm(shift, axis=1), np.abs(offsets)[placed.line.view], atol=1e-9
    )
    np.testing.assert_allclose(np.sum(shift * placed.line.along, axis=1), 0.0, atol=1e-9)
    normals = poses[0][placed.line.view][:, :, 2]
    np.testing.assert_allclose(np.sum(shift * normals, axis=1), 0.0, atol=1e-9)
    np.testing.assert_array_equal(moved.points, placed.points)


@pytest.mark.parametrize(
    "board", [BOARD, replace(BOARD, kind="circles", circle_mm=9.0), folded_body()]
)
def test_a_scaled_board_is_larger_all_over(board):
    larger = scaled_board(board, 1.01)
    np.testing.assert_allclose(larger.points, 1.01 * board.points)
    for before, after in zip(face_outlines(board), face_outlines(larger), strict=True):
        np.testing.assert_allclose(
            np.sort(after, axis=0), np.sort(1.01 * before, axis=0), atol=1e-9
        )
    if isinstance(board, PlanarBoard) and isinstance(larger, PlanarBoard):
        assert larger.circle_diameter == pytest.approx(1.01 * board.circle_diameter)


def test_lines_go_on_beyond_the_board(rig, poses: Poses, rng):
    """The points added lie in the sheet, the gap behind the board, and no ray to them passes
    through it; those on the board are as they were."""
    placed = placed_boards(rig, BOARD, *poses, line_points=100)
    beyond = lines_beyond(rig, BOARD, placed, gap_mm=30.0, line_points=120)
    line, sheet = beyond.line, rig.light_plane
    np.testing.assert_allclose(line.points @ sheet.normal, sheet.distance_mm, atol=1e-8)
    at = np.einsum("ni,nij->nj", line.points - poses[1][line.view], poses[0][line.view])
    off = at[:, 2] > 15.0
    np.testing.assert_allclose(at[off, 2], 30.0)
    np.testing.assert_allclose(at[~off, 2], 0.0, atol=1e-8)
    assert (~off).sum() == VIEWS * 100
    assert len(set(line.view[off])) == VIEWS
    for view in range(VIEWS):
        uv = rig.camera.project(line.points[off & (line.view == view)])
        met, _ = on_board(rig, (poses[0][view], poses[1][view]), uv)
        left, right, top, bottom = RECTANGLE
        inside = (met[:, 0] > left) & (met[:, 0] < right)
        inside &= (met[:, 1] > top) & (met[:, 1] < bottom)
        assert not inside.any()
    views = photographed_boards(rig.camera, beyond, rng, line_std=0.1)
    assert not views.line.face.any()
