"""A sheet of light from the bright spots on the ridges of a zigzag target.

The "jagged target": the sheet crosses the target's sharp edges in bright spots. The edges are
known in the target's frame, its pose in the camera frame from whatever is known on it, and a spot
lies where its edge is met by the camera's ray. F. Duan, F. Liu and S. Ye, "A new accurate method
for the calibration of line structured light sensor", Chinese Journal of Scientific Instrument
21(1), 2000. That paper's text was not at hand, and what was measured beside the camera there, the
spots or the edges, could not be confirmed; the equations are derived here.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.control_points import ControlledSheet, controlled_sheet, placed
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised

_END_ON = 1e-4
"""Squared sine of the angle between ridge and ray, or ridge and the plane of rays, up to which
the spot's place on the ridge is noise."""


def spots_on_ridges(xy: Array, ridges: Array) -> Array:
    """Points of ridges that lie nearest to the rays of their spots.

    With the ridge ``a + s e`` and the unit ray g, ``‖a + s e − t g‖²`` is least at
    ``s = ((e·g)(g·a) − e·a) / (1 − (e·g)²)``.

    Parameters
    ----------
    xy : (L, 2) array
        Ideal normalised image points of the spots; NaN where not seen.
    ridges : (L, 2, 3) array
        Two points of each ridge, mm, camera frame.

    Returns
    -------
    (L, 3) array
        In mm, camera frame; NaN where a ridge is seen end-on, or the point is behind the camera.
    """
    start, along = ridges[:, 0], normalised(ridges[:, 1] - ridges[:, 0])
    ray = normalised(np.column_stack([xy, np.ones(len(xy))]))
    cosine = np.sum(along * ray, axis=1)
    sine2 = np.sum(np.cross(along, ray) ** 2, axis=1)
    place = cosine * np.sum(ray * start, axis=1) - np.sum(along * start, axis=1)
    return _on_ridge(start, along, place, sine2, sine2 > _END_ON)


def stripes_on_ridges(stripes: Array, ridges: Array) -> Array:
    """Points of ridges whose images lie on the image of the line of light.

    The plane ``ℓ · X = 0`` through the camera's centre and the line's image ``ℓ`` meets the ridge
    ``a + s e`` at ``s = −ℓ·a / ℓ·e``. No image of the ridge is needed, only its place in space.

    Parameters
    ----------
    stripes : (L, 3) array
        ``ℓ`` with ``ℓ · (x, y, 1) = 0`` for the line of light on a face beside the ridge.
    ridges : (L, 2, 3) array
        Two points of each ridge, mm, camera frame.

    Returns
    -------
    (L, 3) array
        In mm, camera frame; NaN where the light runs along a ridge, or the point is behind the
        camera.
    """
    start, along = ridges[:, 0], normalised(ridges[:, 1] - ridges[:, 0])
    plane = normalised(stripes)
    slope = np.sum(plane * along, axis=1)
    place = -np.sum(plane * start, axis=1)
    return _on_ridge(start, along, place, slope, slope**2 > _END_ON)


def _on_ridge(start: Array, along: Array, place: Array, slope: Array, clear: np.ndarray) -> Array:
    """``start + place / slope along`` where that is clear and before the camera, else NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        points = start + (place / slope)[:, None] * along
    points[~(clear & (points[:, 2] > 0))] = np.nan
    return points


def zigzag_sheet(xy: Array, ridges: Array, camera_from_target: Array) -> ControlledSheet:
    """The plane through the spots on a zigzag target, in one view or in several.

    One view is enough where ridges of two heights, crests and troughs, were crossed.

    Parameters
    ----------
    xy : (L, 2) array
        Ideal normalised image points of the spots; NaN where not seen.
    ridges : (L, 2, 3) array
        Two points of each spot's ridge, mm, target's frame.
    camera_from_target : (L, 3, 4) array
        Pose ``[R t]`` of the target in each spot's view, mm.

    Raises
    ------
    UntrustworthyError
        If fewer than three spots are there, all ridges lie in one plane, or the spots on a line.
    """
    lines = placed(ridges, camera_from_target)
    return _through(spots_on_ridges(xy, lines), lines)


def zigzag_sheet_of_stripes(
    stripes: Array, ridges: Array, camera_from_target: Array
) -> ControlledSheet:
    """As `zigzag_sheet`, the spots being where the line of light meets the ridges' images.

    Parameters
    ----------
    stripes : (L, 3) array
        ``ℓ`` with ``ℓ · (x, y, 1) = 0`` for the line of light beside each ridge.
    ridges, camera_from_target
        As for `zigzag_sheet`.

    Raises
    ------
    UntrustworthyError
        As in `zigzag_sheet`.
    """
    lines = placed(ridges, camera_from_target)
    return _through(stripes_on_ridges(stripes, lines), lines)


def _through(points: Array, lines: Array) -> ControlledSheet:
    crossed = np.isfinite(points).all(axis=1)
    if not crossed.any():
        raise UntrustworthyError(
            "plane", "no ridge is crossed by the light before the camera", "check the target's pose"
        )
    return controlled_sheet(points, lines[crossed].reshape(-1, 3))
