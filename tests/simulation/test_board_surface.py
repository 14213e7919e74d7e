"""Rendered boards against measures that share nothing with the renderer."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from sheetoflight.errors import InputError
from sheetoflight.geometry.rotations import rotation
from sheetoflight.imaging.marker_codes import marker_codes
from sheetoflight.model.board import PlanarBoard, SolidTarget
from sheetoflight.simulation.board_surface import board_border, board_surface
from sheetoflight.simulation.render import RenderOptions, brightness, render
from sheetoflight.simulation.scene import INK, WHITE, Scene, wall_surface

EVEN = RenderOptions(ambient_level=0.7, ambient_gradient=(0.0, 0.0), vignetting=0.0, noise=False)
CHESSBOARD = PlanarBoard("chessboard", 6, 4, (16.0, 14.0))
CHARUCO = PlanarBoard("charuco", 6, 4, (16.0, 16.0), dictionary="DICT_5X5_50")
TILTED = rotation(np.array([0.5, -0.4, 0.3]))
SQUARE_ON = rotation(np.array([0.0, 0.0, 0.2]))


@pytest.fixture
def rig(small_rig):
    """A longer lens, so that a field is about 25 px wide."""
    return replace(small_rig, camera=replace(small_rig.camera, alpha=1600.0, beta=1590.0))


def shift(board: PlanarBoard, turn: np.ndarray) -> np.ndarray:
    """Of the board with its middle before the camera."""
    return np.array([4.0, -3.0, 1000.0]) - turn @ board.points.mean(axis=0)


def pictured(rig, board, turn, codes=()) -> tuple[np.ndarray, np.ndarray]:
    """Its picture without noise, on a wall, and OpenCV's projection of its points."""
    at = shift(board, turn)
    scene = Scene((board_surface(board, turn, at, codes), wall_surface(rig, 1500.0)))
    picture = brightness(rig, scene, EVEN, laser=False) / EVEN.ambient_level
    return picture, projected(rig, board.points, turn, at)


def projected(rig, points, turn, at) -> np.ndarray:
    uv, _ = cv2.projectPoints(points, cv2.Rodrigues(turn)[0], at, rig.camera.matrix, np.zeros(5))
    return uv[:, 0]


def test_chessboard_corners_are_points_of_symmetry(rig):
    """Turned by 180° about a corner, the picture of two black and two white fields is itself,
    whatever the symmetric blur: the point of which that is true is sought from half a pixel
    away, and lies where OpenCV projects the corner. Perspective changes widths by 1 % over
    these 4 px; 0.01 px is left for it and for sampling."""
    picture, expected = pictured(rig, CHESSBOARD, TILTED)
    smooth = RectBivariateSpline(np.arange(240), np.arange(320), picture, kx=3, ky=3)
    du, dv = (a.ravel() for a in np.meshgrid(np.arange(-4.0, 4.5), np.arange(-4.0, 4.5)))

    def value(u, v, across=0, down=0):
        return smooth(v, u, dx=down, dy=across, grid=False)

    for corner in expected:
        u, v = corner[0] + 0.5, corner[1] - 0.4
        step = np.zeros(2)
        for _ in range(20):
            odd = value(u + du, v + dv) - value(u - du, v - dv)
            slopes = [
                value(u + du, v + dv, *axis) - value(u - du, v - dv, *axis)
                for axis in ((1, 0), (0, 1))
            ]
            step = np.linalg.lstsq(np.stack(slopes, axis=1), -odd, rcond=None)[0]
            u, v = u + step[0], v + step[1]
        assert np.abs(step).max() < 1e-6
        np.testing.assert_allclose([u, v], corner, atol=0.01)


@pytest.mark.parametrize(
    "board",
    [
        PlanarBoard("circles", 6, 5, (16.0, 15.0)),
        PlanarBoard("circles", 3, 6, (10.0, 10.0), staggered=True),
    ],
    ids=["grid", "staggered"],
)
def test_circles_square_on_are_centred_on_their_points(rig, board):
    """A disc parallel to the picture has a disc as its image: its ink's centroid is its centre,
    its ink's sum its area."""
    picture, expected = pictured(rig, board, SQUARE_ON)
    ink = (WHITE - picture) / (WHITE - INK)
    grid_v, grid_u = np.mgrid[:240, :320]
    scale = rig.camera.alpha * rig.camera.beta / 1000.0**2
    area = np.pi * (board.circle_diameter / 2) ** 2 * scale
    for u, v in expected:
        near = ink * (np.hypot(grid_u - u, grid_v - v) < board.circle_diameter * 1.6 / 2 + 4.0)
        centroid = (near * grid_u).sum() / near.sum(), (near * grid_v).sum() / near.sum()
        np.testing.assert_allclose(centroid, (u, v), atol=0.005)
        assert near.sum() == pytest.approx(area, rel=1e-3)


def test_the_first_field_is_black_and_the_border_white(rig):
    """The middle of every field, and of the border: black where row and column, counted from the
    first field beyond the first corner, make an even sum."""
    picture, _ = pictured(rig, CHESSBOARD, TILTED)
    x, y = CHESSBOARD.pitch_mm
    for row in range(5):
        for column in range(7):
            middle = np.array([[(column - 0.5) * x, (row - 0.5) * y, 0.0]])
            (uv,) = projected(rig, middle, TILTED, shift(CHESSBOARD, TILTED))
            u, v = np.rint(uv).astype(int)
            assert picture[v, u] == pytest.approx(WHITE if (row + column) % 2 else INK, abs=1e-3)
    edge = -np.array([[x + board_border(CHESSBOARD) / 2, -20.0, 0.0]])
    (uv,) = projected(rig, edge, TILTED, shift(CHESSBOARD, TILTED))
    u, v = np.rint(uv).astype(int)
    assert picture[v, u] == pytest.approx(WHITE, abs=0.02)


def test_opencv_reads_every_marker_and_corner_of_a_charuco_board(rig):
    """Under the number it has on OpenCV's own board; and its corners in their places: each within
    a pixel, of 25 to the next one."""
    codes = marker_codes(CHARUCO)
    picture, expected = pictured(rig, CHARUCO, TILTED, codes)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    board = cv2.aruco.CharucoBoard((7, 5), 16.0, CHARUCO.marker_side, dictionary)
    corners, ids, _, markers = cv2.aruco.CharucoDetector(board).detectBoard(
        np.rint(picture * 200).astype(np.uint8)
    )
    assert sorted(np.ravel(markers)) == list(range(17))
    assert sorted(np.ravel(ids)) == list(range(24))
    found = np.reshape(corners, (-1, 2))
    np.testing.assert_allclose(found, expected[np.asarray(ids, dtype=int).ravel()], atol=1.0)


def line_of_light(rig, board, ink):
    """The light that the laser alone adds to a board."""
    at = np.array([89.0, 0.0, 1000.0]) - SQUARE_ON @ board.points.mean(axis=0)
    scene = Scene((board_surface(board, SQUARE_ON, at, ink=ink),))
    return brightness(rig, scene, replace(EVEN, ambient_level=0.0), laser=True)


def test_light_across_the_line_is_its_irradiance_times_its_width(small_rig):
    """On bare white, every row's light sums to ``L √(2π) σ / |dw/du|``: L by the distance and
    incidence from the projector, w the distance from the sheet along the row on the plane
    Z = 1000. Its centroid is the line."""
    options, sheet, camera = EVEN, small_rig.light_plane, small_rig.camera
    light = line_of_light(small_rig, PlanarBoard("chessboard", 6, 4, (16.0, 14.0)), ink=WHITE)
    for row in range(105, 130):
        y = (row - camera.v0) / camera.beta * 1000.0
        x = (sheet.distance_mm - sheet.normal[1] * y - sheet.normal[2] * 1000.0) / sheet.normal[0]
        to_point = np.array([x, y, 1000.0]) - small_rig.projector_mm
        reach = np.linalg.norm(to_point)
        level = options.laser_level * options.laser_reference_mm / reach * to_point[2] / reach
        per_px = sheet.normal[0] * 1000.0 / camera.alpha
        energy = level * np.sqrt(2.0 * np.pi) * options.sheet_sigma_mm / per_px
        assert light[row].sum() == pytest.approx(energy, rel=2e-3)
        centroid = (light[row] * np.arange(320)).sum() / light[row].sum()
        assert centroid == pytest.approx(camera.u0 + camera.alpha * x / 1000.0, abs=0.005)


def test_the_line_is_dim_on_ink(small_rig):
    """Row by row, the light on a chessboard lies between that on white and the ink's share of
    it, and comes near both: the line crosses black fields and white ones."""
    white = line_of_light(small_rig, CHESSBOARD, ink=WHITE)[105:130].sum(axis=1)
    share = line_of_light(small_rig, CHESSBOARD, ink=INK)[105:130].sum(axis=1) / white
    assert share.min() >= INK - 1e-6
    assert share.max() <= 1.0 + 1e-6
    assert share.min() < 2 * INK
    assert share.max() > 0.95


def test_a_board_hides_the_wall_and_shades_it(small_rig):
    """The laser's line on the wall has a gap: pictured with the board and without."""
    at = np.array([89.0, 0.0, 1000.0]) - SQUARE_ON @ CHESSBOARD.points.mean(axis=0)
    wall = wall_surface(small_rig, 1500.0)
    sheet = board_surface(CHESSBOARD, SQUARE_ON, at)
    dark = replace(EVEN, ambient_level=0.0)
    alone, with_board = (
        render(small_rig, Scene(surfaces), dark, laser=True).astype(int)
        for surfaces in ((wall,), (sheet, wall))
    )
    on_wall = alone.argmax(axis=1)
    rows = np.arange(240)
    kept = with_board[rows, on_wall] == alone[rows, on_wall]
    assert 20 < (~kept).sum() < 120
    assert kept[:40].all()
    assert kept[-40:].all()


def test_markers_need_codes():
    with pytest.raises(InputError, match="17 markers, and 3 codes"):
        board_surface(CHARUCO, np.eye(3), np.zeros(3) + 500.0, marker_codes(CHARUCO)[:3])


def test_a_solid_body_has_no_pattern():
    body = SolidTarget(np.vstack([np.eye(3), -np.eye(3)]))
    with pytest.raises(InputError, match="solid body"):
        board_surface(body, np.eye(3), np.array([0.0, 0.0, 500.0]))
