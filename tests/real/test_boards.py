"""Chessboards on other people's photographs: how many are found, and what cameras they give.

The judge of the corners is OpenCV's own calibration, and the parameters that the photographs'
authors published. Nothing is set by hand.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from sheetoflight.imaging.boards import find_board
from sheetoflight.model.board import PlanarBoard

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "shared" / "real"
TURNED = sorted((PHOTOGRAPHS / "ciclop_3dscanscience" / "camera").glob("*.jpg"))
HAND_HELD = sorted((PHOTOGRAPHS / "srv_desktop" / "camera").glob("*.jpg"))
DESKTOP = sorted((PHOTOGRAPHS / "srv_desktop" / "laser").glob("*.jpg"))
BENT = sorted((PHOTOGRAPHS / "hjamal_green").glob("*.jpg"))
ROBOT = PHOTOGRAPHS / "etna_robot"
DRAWN = PHOTOGRAPHS / "synthcal_generated" / "frames"
EVERY = 6

pytestmark = pytest.mark.skipif(
    not PHOTOGRAPHS.is_dir(),
    reason=f"the photographs are not here: no folder {Path('..') / 'shared' / 'real'}",
)


def photograph(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture


def upright(path: Path) -> np.ndarray:
    """As the authors turned it before they calibrated."""
    return np.asarray(cv2.flip(cv2.transpose(photograph(path)), 1))


def sightings(pictures, board):
    searches = [find_board(picture, board) for picture in pictures]
    return [search.sighting for search in searches if search.sighting is not None]


def camera_of(found, board, size):
    """fx, fy, cx, cy and the rms of reprojection, by OpenCV, all corners of equal weight."""
    seen = [np.isfinite(f.std) for f in found]
    points = [board.points[s].astype(np.float32) for s in seen]
    uv = [f.uv[s].astype(np.float32) for f, s in zip(found, seen, strict=True)]
    start = np.eye(3), np.zeros(5)
    rms, matrix, *_ = cv2.calibrateCamera(points, uv, size, *start)
    return np.asarray(matrix)[[0, 1, 0, 1], [0, 1, 2, 2]], rms


def test_sixteen_sharp_photographs_give_the_published_camera():
    board = PlanarBoard("chessboard", 11, 6, (13.0, 13.0))
    found = sightings([upright(path) for path in TURNED], board)
    assert len(found) == len(TURNED) == 16
    assert all(np.isfinite(f.std).all() for f in found)
    camera, rms = camera_of(found, board, (960, 1280))
    assert np.abs(camera - [1430.39147, 1429.66307, 636.40393, 478.03271]).max() < 0.05
    assert rms < 0.25


def test_hand_held_photographs_give_the_published_camera():
    board = PlanarBoard("chessboard", 8, 6, (40.0, 40.0))
    found = sightings([photograph(path) for path in HAND_HELD], board)
    assert len(found) == len(HAND_HELD) == 27
    camera, rms = camera_of(found, board, (640, 480))
    assert np.abs(camera - [620.27, 618.61, 322.95, 239.42]).max() < 2.5
    assert rms < 0.15


@pytest.mark.parametrize("name", ["calib2", "set0"])
def test_every_dim_plate_beside_a_saturated_line_is_found(name):
    board = PlanarBoard("chessboard", 7, 6, (10.0, 10.0))
    paths = sorted((ROBOT / name).glob("frame*.png"))
    found = sightings([photograph(path) for path in paths], board)
    assert len(found) == len(paths) == 8
    assert min(np.isfinite(f.std).sum() for f in found) >= 40


def smooth_map_errors(found, board):
    """Each corner against a polynomial of degree 4 through the clear ones, in robust spreads."""
    x, y = (board.points[:, :2] / np.ptp(board.points[:, :2], axis=0) * 2 - 1).T
    terms = [x**i * y**j for i in range(5) for j in range(5 - i)]
    design, seen = np.stack(terms, axis=-1), np.isfinite(found.std)
    coefficients = np.linalg.lstsq(design[seen], found.uv[seen], rcond=None)[0]
    return np.linalg.norm(found.uv[seen] - design[seen] @ coefficients, axis=1)


def test_a_bent_board_with_the_line_across_it_is_found_and_its_lit_corners_are_left_out():
    """The line runs along a column of 8 corners within 15 px, or between two columns."""
    board = PlanarBoard("chessboard", 6, 8, (40.0, 40.0))
    found = sightings([photograph(path) for path in BENT], board)
    assert len(found) == len(BENT) == 6
    left_out = [int(np.isnan(f.std).sum()) for f in found]
    assert all(n <= 10 for n in left_out)
    assert sum(n > 0 for n in left_out) >= 5
    for f in found:
        error = smooth_map_errors(f, board)
        assert error.max() < 8.0 * np.median(error)


def test_every_whole_board_on_the_desktop_is_found_and_the_others_are_told():
    """Every sixth photograph; six of the 21 boards run out of the picture."""
    board = PlanarBoard("chessboard", 8, 6, (40.0, 40.0))
    searches = [find_board(photograph(path), board) for path in DESKTOP[::EVERY]]
    found = [s.sighting for s in searches if s.sighting is not None]
    assert len(searches) == 21
    assert len(found) >= 15
    assert min(np.isfinite(f.std).sum() for f in found) >= 36
    reasons = [s.reason for s in searches if s.sighting is None]
    assert sum("runs out" in reason for reason in reasons) >= 4


def test_corners_drawn_by_others_lie_where_they_were_drawn():
    """One of the ten boards lies along the pixels, its edges drawn in steps: the tenth limit."""
    board = PlanarBoard("chessboard", 11, 8, (12.0, 12.0))
    rms = []
    for folder in sorted(DRAWN.iterdir()):
        drawn = np.load(folder / "cam00_corners_px.npy").reshape(-1, 2)
        (found,) = sightings([photograph(folder / "cam00_target.png")], board)
        away = np.linalg.norm(found.uv[:, None] - drawn, axis=-1).min(axis=1)
        rms.append(np.sqrt(np.mean(away**2) / 2))
    assert len(rms) == 10
    assert sorted(rms)[8] < 0.04
    assert max(rms) < 0.1
