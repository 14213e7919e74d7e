"""Where a board ends, in the picture and in space, and where a sheet of light cuts it."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.light_plane import LightPlane

_REACH = 2.0
"""How many times as large as its pattern a board may be: where the line of light is seen beside the
points."""


def outline(uv: Array) -> np.ndarray:
    """Numbers of the outermost image points, in order, the first of them again at the end.

    A camera keeps the outline of a flat board: the same points bound it in space.

    Parameters
    ----------
    uv : (M, 2) array
        px; NaN where a point was not seen.

    Returns
    -------
    (K + 1,) int array
        Empty where no point was seen.
    """
    seen = np.flatnonzero(np.isfinite(uv).all(axis=1))
    if not len(seen):
        return seen
    around = cv2.convexHull(uv[seen].astype(np.float32), returnPoints=False).ravel()
    return seen[[*around, around[0]]]


def cut_by_sheet(outline_xyz: Array, plane: LightPlane) -> Array:
    """Points ``(N, 3)`` at which the closed outline ``(K, 3)`` passes through a sheet of light.

    Both in the camera frame, mm. Of a flat board seen whole they are two, or none.
    """
    off = plane.heights(outline_xyz)
    before, after = off[:-1], off[1:]
    with np.errstate(invalid="ignore"):
        passing = before * after < 0
    share = (before[passing] / (before - after)[passing])[:, None]
    return outline_xyz[:-1][passing] + share * np.diff(outline_xyz, axis=0)[passing]


def seen_in_sheet(outline_xyz: Array, plane: LightPlane) -> Array:
    """Where a board lies in a sheet of light, roughly: ``(N, 3)``, camera frame, mm.

    The ends of the line across the points, or, where it passes beside them, those of the line
    across a board twice as large.

    Parameters
    ----------
    outline_xyz : (K + 1, 3) array
        A closed outline.
    plane : LightPlane
    """
    across = cut_by_sheet(outline_xyz, plane)
    if len(across) or not len(outline_xyz):
        return across
    middle = outline_xyz[:-1].mean(axis=0)
    return cut_by_sheet(middle + _REACH * (outline_xyz - middle), plane)
