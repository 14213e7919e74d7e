"""Sheets from lines on boards, against the truth of another author's generator.

Its pictures are not read: the corners and the line's centres are those it wrote beside them, in
single precision, so that no detector has a part in what is judged. Poses are OpenCV's.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from sheetoflight.calibration.planar_lines import (
    planes_of_boards,
    sheet_by_points,
    sheet_by_vanishing_points,
)
from sheetoflight.model.board import PlanarBoard

DRAWN = Path(__file__).resolve().parents[3] / "shared" / "real" / "synthcal_generated"

pytestmark = pytest.mark.skipif(
    not DRAWN.is_dir(),
    reason=f"the pictures are not here: no folder {Path('..') / 'shared' / 'real' / DRAWN.name}",
)


@pytest.fixture(scope="module")
def drawn():
    """Ideal image points of the line, their views, the boards' planes, and the true sheet."""
    truth = yaml.safe_load((DRAWN / "config.yaml").read_text())
    camera = truth["rig"]["cameras"][0]
    K, lens = np.array(camera["K"]), np.array(camera["dist"])
    board = PlanarBoard("chessboard", 11, 8, (12.0, 12.0)).points
    poses, xy, view = [], [], []
    for number, folder in enumerate(sorted((DRAWN / "frames").iterdir())):
        corners = np.load(folder / "cam00_corners_px.npy").astype(float)
        _, turn, shift = cv2.solvePnP(board, corners, K, lens)
        poses.append(np.column_stack([cv2.Rodrigues(turn)[0], shift]))
        line = np.load(folder / "cam00_stripe_centerline_px.npy").astype(float)
        line = line[np.load(folder / "cam00_stripe_centerline_visible.npy")]
        xy.append(np.asarray(cv2.undistortPoints(line[:, None], K, lens))[:, 0])
        view.append(np.full(len(line), number))
    planes = planes_of_boards(np.array(poses))
    return np.concatenate(xy), np.concatenate(view), planes, truth


@pytest.mark.parametrize("method", [sheet_by_points, sheet_by_vanishing_points])
def test_the_drawn_sheet_is_found(drawn, method):
    xy, view, planes, truth = drawn
    written = np.array(truth["laser"]["plane_in_tcp"])  # n · X + d = 0; camera and tool are one
    assert np.array_equal(truth["rig"]["cameras"][0]["T_tcp_cam"], np.eye(4))
    written = written / np.linalg.norm(written[:3])
    found = method(xy, view, planes)
    angle = np.degrees(np.linalg.norm(np.cross(found.normal, written[:3])))
    assert float(found.normal @ written[:3]) > 0
    assert angle < 0.01
    assert found.distance == pytest.approx(-written[3], abs=0.02)
