"""The picture without a board that was found, and where a board is, in words."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.grid import outline
from sheetoflight.imaging.markers.grey import Picture


def blanked(values: Picture, grid: Array) -> Picture:
    """The picture with the board and its outer squares painted over in their mean grey."""
    area = np.rint(np.clip(outline(grid), -1e5, 1e5)).astype(np.int32)
    blank = values.copy()
    mask = cv2.fillConvexPoly(np.zeros(values.shape, np.uint8), cv2.convexHull(area), 1)
    blank[mask > 0] = values[mask > 0].mean()
    return blank


def where(grid: Array) -> str:
    """The middle of a grid ``(rows, columns, 2)`` of image points: ``(640, 480)``."""
    u, v = grid.reshape(-1, 2).mean(axis=0)
    return f"({u:.0f}, {v:.0f})"
