"""The board's plane in the picture, as far as a lens without distortion shows it."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard

_FEWEST = 4


def plane_to_picture(board: PlanarBoard, uv: Array) -> Array | None:
    """Homography ``(3, 3)`` from the board's x, y (mm) to px by least squares; None where the
    points seen do not span a plane.

    Parameters
    ----------
    board : PlanarBoard
    uv : (M, 2) array
        Image points, px; NaN where not seen.
    """
    seen = np.isfinite(uv).all(axis=1)
    points = board.points[seen, :2]
    if seen.sum() < _FEWEST or np.linalg.matrix_rank(points - points.mean(axis=0)) < 2:
        return None
    matrix, _ = cv2.findHomography(points, uv[seen], 0)
    if matrix is None or np.shape(matrix) != (3, 3) or not np.isfinite(matrix).all():
        return None
    return np.asarray(matrix, dtype=float)


def mapped(matrix: Array, xy: Array) -> Array:
    """Points ``(..., 2)`` through a homography."""
    out = xy @ matrix[:, :2].T + matrix[:, 2]
    return out[..., :2] / out[..., 2:]


def on_grid(matrix: Array, board: PlanarBoard) -> Array:
    """All points of the board as a grid ``(rows, columns, 2)``, px."""
    return mapped(matrix, board.points[:, :2]).reshape(board.rows, board.columns, 2)
