"""A sheet of light from its lines on planar boards.

The two methods with boards that stand beside the collinear rod:

- by points: the rays of the line's image meet the board's plane in points of the sheet, and the
  sheet is the plane through those of all views. F. Zhou and G. Zhang, "Complete calibration of a
  structured light stripe vision sensor through planar target of unknown orientations", Image and
  Vision Computing 23(1), 2005. Only its abstract was at hand: two or more orientations of a
  planar target, of unknown motion, give control points that are not collinear. That every point
  of the line is used, and not its crossings with printed lines alone, is a choice made here.
- by vanishing points: the lines' directions lie in the sheet, so that their vanishing points lie
  on its vanishing line, which is its normal. X. Xu et al., "Line structured light calibration
  method and centerline extraction: A review", Results in Physics 19, 2020, 103637, count
  vanishing points and lines among the major methods; the equations below are derived here.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.control_points import (
    ControlledSheet,
    controlled_sheet,
    image_lines,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis

_PARALLEL = 1e-2
"""Second singular value of the lines' directions, as a part of the first, up to which they count
as parallel: half the angle between them, in radians, where they are two."""


def planes_of_boards(camera_from_board: Array) -> Array:
    """Planes ``(N, 4)`` of flat boards, ``m · X = c`` as (m, c) in the camera frame.

    Parameters
    ----------
    camera_from_board : (N, 3, 4) array
        Poses ``[R t]``, mm; a board's plane is z = 0 of its own frame.
    """
    normal = camera_from_board[:, :, 2]
    return np.column_stack([normal, np.sum(normal * camera_from_board[:, :, 3], axis=1)])


def points_on_planes(xy: Array, planes: Array) -> Array:
    """Points ``(P, 3)`` where rays meet planes: ``c r / (m · r)`` with ``r = (x, y, 1)``.

    Parameters
    ----------
    xy : (P, 2) array
        Ideal normalised image points.
    planes : (P, 4) array
        The plane that each point lies on, as (m, c), mm, camera frame.

    Returns
    -------
    (P, 3) array
        In mm, camera frame; NaN where a ray meets its plane behind the camera, or not at all.
    """
    rays = np.column_stack([xy, np.ones(len(xy))])
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = planes[:, 3] / np.sum(planes[:, :3] * rays, axis=1)
    return np.where((depth > 0) & np.isfinite(depth), depth, np.nan)[:, None] * rays


def sheet_by_points(xy: Array, view: np.ndarray, planes: Array) -> ControlledSheet:
    """The plane through the line's points on the boards of all views.

    Parameters
    ----------
    xy : (P, 2) array
        Ideal normalised image points of the line.
    view : (P,) int array
        The view, or the face in a view, that each point belongs to.
    planes : (N, 4) array
        The board's plane ``m · X = c`` in each, as (m, c), mm, camera frame.

    Raises
    ------
    UntrustworthyError
        If the line was seen in one plane only, or on one line of space only.

    Examples
    --------
    >>> xy = np.array([[0.1, -0.2], [0.1, 0.2], [0.05, -0.2], [0.05, 0.2]])
    >>> boards = np.array([[0, 0, 1.0, 400], [0, 0, 1.0, 800]])
    >>> sheet = sheet_by_points(xy, np.array([0, 0, 1, 1]), boards)
    >>> sheet.normal.round(6) + 0.0, round(sheet.distance, 6)
    (array([1., 0., 0.]), 40.0)
    """
    points = points_on_planes(xy, planes[view])
    return controlled_sheet(points, _pieces_of_boards(points, view, planes))


def _pieces_of_boards(points: Array, view: np.ndarray, planes: Array) -> Array:
    """Corners ``(C, 3)`` of a square in each view's board, as large as the line there."""
    there = np.isfinite(points).all(axis=1)
    corners = []
    for number in np.unique(view[there]):
        own = points[there & (view == number)]
        middle = own.mean(axis=0)
        reach = np.sqrt(2.0) * np.linalg.norm(own - middle, axis=1).max()
        for side in tangent_basis(normalised(planes[number, :3])):
            corners += [middle + reach * side, middle - reach * side]
    return np.array(corners).reshape(-1, 3)


def sheet_by_vanishing_points(xy: Array, view: np.ndarray, planes: Array) -> ControlledSheet:
    """The plane whose vanishing line passes through the vanishing points of its lines.

    The image ``ℓ`` of the line on a board of normal m has the vanishing point ``v = ℓ × m``: the
    direction of space that lies in the board, and in the plane through the camera's centre and
    ``ℓ``. All of them are in the sheet, ``n · v = 0``, so that n is the right singular vector of
    the smallest singular value of the unit directions. The distance is the mean of ``n · X`` over
    the line's points.

    Parameters
    ----------
    xy, view, planes
        As for `sheet_by_points`.

    Raises
    ------
    UntrustworthyError
        If the lines are parallel in space, as they are on boards that were only shifted;
        `sheet_by_points` works then. Also where fewer than two lines are there, or none of their
        points lies before the camera.
    """
    there = np.isfinite(xy).all(axis=1)
    lines = image_lines(xy[there], view[there], len(planes))
    whole = np.isfinite(lines).all(axis=1)
    directions = normalised(np.cross(lines[whole], planes[whole, :3]))
    # a row of zeros, so that two directions too have a third singular vector
    _, size, vectors = np.linalg.svd(np.pad(directions, ((0, 1), (0, 0))), full_matrices=False)
    if len(directions) < 2 or size[1] <= _PARALLEL * size[0]:
        raise UntrustworthyError(
            "plane",
            f"the {len(directions)} lines of light are parallel in space, or fewer than two, "
            "and leave the sheet free to turn about them",
            "tilt the board between the views",
        )
    normal = vectors[2]
    points = points_on_planes(xy, planes[view])
    known = points[np.isfinite(points).all(axis=1)]
    if not len(known):
        raise UntrustworthyError(
            "plane",
            "no point of the lines lies on a board before the camera",
            "check the boards' poses",
        )
    distance = float(np.mean(known @ normal))
    sign = -1.0 if distance < 0 else 1.0
    return ControlledSheet(sign * normal, sign * distance, points)
