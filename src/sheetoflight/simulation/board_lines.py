"""Where sheets of light meet the faces of boards and bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.curved_lines import line_on_face, moved_across
from sheetoflight.simulation.rig import SimulatedRig


@dataclass(frozen=True, eq=False)
class LinePoints:
    """Points of lines of light in space.

    Parameters
    ----------
    points : (P, 3) array
        mm, camera frame.
    along : (P, 3) array
        Unit vectors along the lines.
    view, laser, face : (P,) int array
    """

    points: Array
    along: Array
    view: np.ndarray
    laser: np.ndarray
    face: np.ndarray

    def take(self, points: np.ndarray) -> LinePoints:
        """The points that an index array or mask selects."""
        return LinePoints(
            self.points[points],
            self.along[points],
            self.view[points],
            self.laser[points],
            self.face[points],
        )


def face_outlines(board: Board) -> tuple[Array, ...]:
    """Corners ``(K, 3)`` of every face in order around it, board's frame, mm.

    A board reaches one pitch beyond its outermost points; a body's face is the convex hull of
    the points that were named for it.
    """
    if isinstance(board, PlanarBoard):
        (left, top), (right, bottom) = board.points[0, :2], board.points[:, :2].max(axis=0)
        x, y = board.pitch_mm
        corners = [
            (left - x, top - y, 0.0),
            (right + x, top - y, 0.0),
            (right + x, bottom + y, 0.0),
            (left - x, bottom + y, 0.0),
        ]
        return (np.array(corners),)
    return tuple(
        _hull(board.points[list(numbers)], face[:3])
        for numbers, face in zip(board.face_points, board.faces, strict=True)
    )


def chords(corners: Array, sheet: LightPlane) -> Array:
    """Ends ``(N, 2, 3)`` of the lines in which a sheet meets convex polygons ``(N, K, 3)``, mm.

    Of a curved sheet those of the plane that it bends away from. NaN where it does not.
    """
    above = corners @ sheet.normal - sheet.distance_mm
    next_corners, next_above = np.roll(corners, -1, axis=1), np.roll(above, -1, axis=1)
    crossed = (above > 0) != (next_above > 0)
    two = np.argsort(~crossed, axis=1, kind="stable")[:, :2]
    share = above / np.where(crossed, above - next_above, 1.0)
    meetings = corners + share[..., None] * (next_corners - corners)
    ends = np.take_along_axis(meetings, two[..., None], axis=1)
    return np.where(crossed.any(axis=1)[:, None, None], ends, np.nan)


def line_ends(corners: Array, rig: SimulatedRig, laser: int = 0) -> Array:
    """Ends ``(2, 3)`` of the line of a laser on a face ``(K, 3)``, mm; of a curved sheet those of
    its plane's line, moved on to it within the face. NaN where there is no line."""
    (ends,) = chords(corners[None], rig.light_planes[laser])
    if rig.is_flat(laser) or np.isnan(ends).any():
        return ends
    return moved_across(rig.surface(laser), corners, ends)


def lines_on_faces(
    rig: SimulatedRig,
    outlines: list[Array],
    count: int,
    lit: np.ndarray | None = None,
) -> LinePoints:
    """The lines of light on boards.

    A curved sheet's are curves; their points are as many and as dense as those of its plane, less
    those that come to lie beyond the face.

    Parameters
    ----------
    rig : SimulatedRig
    outlines : list of (N, K, 3) arrays
        Corners of every face, in every view, in the camera frame, mm.
    count : int
        Points on each laser's line in a view, evenly along the undistorted picture of its pieces;
        rounded for each piece.
    lit : (N, lasers) mask, optional
        Which lasers shine in which view; by default all.

    Returns
    -------
    LinePoints
        Ordered by view, laser and face.
    """
    ends = np.stack(
        [[chords(corners, sheet) for corners in outlines] for sheet in rig.light_planes]
    )  # (lasers, faces, N, 2, 3)
    shares = _picture_lengths(ends)
    if lit is not None:
        shares = shares * np.asarray(lit, dtype=float).T[:, None, :]
    shares = count * shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
    pieces = list(_pieces(rig, outlines, ends, np.rint(shares).astype(int)))
    points = np.concatenate([np.empty((0, 3)), *(p for p, _, _ in pieces)])
    along = np.concatenate([np.empty((0, 3)), *(a for _, a, _ in pieces)])
    places = [np.tile(at, (len(p), 1)) for p, _, at in pieces]
    laser, face, view = np.concatenate([np.empty((0, 3), dtype=int), *places]).T
    order = np.lexsort((face, laser, view))
    return LinePoints(points, along, view, laser, face).take(order)


def _picture_lengths(ends: Array) -> Array:
    """Length ``(...)`` of the picture of line pieces ``(..., 2, 3)``; 0 where there is none."""
    picture = ends[..., :2] / ends[..., 2:]
    return np.nan_to_num(np.linalg.norm(picture[..., 1, :] - picture[..., 0, :], axis=-1))


def _pieces(
    rig: SimulatedRig, outlines: list[Array], ends: Array, counts: np.ndarray
) -> Iterator[tuple[Array, Array, tuple[int, int, int]]]:
    """Points and directions of every piece ``(laser, face, view)`` that has any."""
    for at in zip(*np.nonzero(counts), strict=True):
        laser, face, view = at
        first, last = ends[at]
        points = _even_in_picture(first, last, int(counts[at]))
        if rig.is_flat(laser):
            yield points, np.broadcast_to(normalised(last - first), points.shape), at
        else:
            yield *line_on_face(rig.surface(laser), outlines[face][view], points), at


def _even_in_picture(first: Array, last: Array, count: int) -> Array:
    """Points ``(count, 3)`` of a line piece, evenly along its picture.

    Along the picture ``1/Z`` is linear, and so is ``(X, Y, 1)/Z``.
    """
    share = ((np.arange(count) + 0.5) / count)[:, None]
    inverse = (1.0 - share) / first[2] + share / last[2]
    return ((1.0 - share) * first / first[2] + share * last / last[2]) / inverse


def _hull(points: Array, normal: Array) -> Array:
    """The convex hull of coplanar points ``(n, 3)``, in order."""
    from scipy.spatial import ConvexHull

    flat = points @ np.stack(tangent_basis(normal)).T
    return points[ConvexHull(flat).vertices]
