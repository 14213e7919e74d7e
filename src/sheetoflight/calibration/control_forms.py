"""The closed forms for a sheet of light, made ready for the boards of a rig.

Each finds control points, and lays the plane through them. What differs is what a control point
hangs on: planar lines have one for every pixel of the line, the cross-ratio one where a line of
light crosses a printed line, the zigzag one where it meets a ridge. A `ControlForm` says that in
numbers, so that errors can be followed through all of them in one way (`control_influence`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_planes import faces_in_space
from sheetoflight.calibration.control_points import ControlledSheet, image_lines, placed
from sheetoflight.calibration.cross_ratio import cross_ratio_points, cross_ratio_sheet
from sheetoflight.calibration.known_lines import printed_lines, ridges
from sheetoflight.calibration.planar_lines import sheet_by_points
from sheetoflight.calibration.zigzag import stripes_on_ridges, zigzag_sheet_of_stripes
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, SolidTarget
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.camera import Camera

_BESIDE = 0.05
"""How far, as a part of a length, something may seem to be beside its end that is on it."""

_BEYOND = 0.5
"""How far beyond its outermost points, as a part of its length, a printed line may be crossed: the
further, the less the cross-ratio knows."""

_FEWEST_SPOTS = 3


@dataclass(frozen=True, eq=False)
class Sights:
    """All that a closed form computes a sheet from.

    Parameters
    ----------
    camera : Camera
    poses : (N, 3, 4) array
        camera_from_target of the views, mm.
    line_uv : (P, 2) array
        Points of the lines of one laser, px.
    known_uv : (K, J, 2) array
        The target's points that each control point is found between, px, NaN where not seen; no
        J where the picture of them is not used.
    """

    camera: Camera
    poses: Array
    line_uv: Array
    known_uv: Array

    @property
    def line_xy(self) -> Array:
        """``(P, 2)`` ideal normalised image points of the lines."""
        return self.camera.unproject(self.line_uv)[:, :2]

    @property
    def known_xy(self) -> Array:
        """``(K, J, 2)`` ideal normalised image points of the target's points."""
        return self.camera.unproject(self.known_uv)[..., :2]


@dataclass(frozen=True, eq=False)
class ControlForm:
    """A closed form, and what each of its K control points hangs on.

    Parameters
    ----------
    place : callable
        From `Sights` to the sheet through K control points.
    sights : Sights
        As they were seen.
    view, line : (K,) int arrays
        The view of each control point, and the line of light, counted as `lines` has them.
    known : (K, J) int array
        Numbers of the target's points in ``sights.known_uv``.
    lines : (P,) int array
        The line of light that each of its pixels belongs to.
    by_pixel : bool
        Whether control point k is of pixel k alone; else it is of all pixels of its line, by
        their total least-squares line.
    """

    place: Callable[[Sights], ControlledSheet]
    sights: Sights
    view: np.ndarray
    line: np.ndarray
    known: np.ndarray
    lines: np.ndarray
    by_pixel: bool = False


ControlFormOf = Callable[[Board, BoardViews, Camera, Array], ControlForm]
"""From a board, its views with the lines of one laser, the camera and the poses."""


def planar_lines(board: Board, views: BoardViews, camera: Camera, poses: Array) -> ControlForm:
    """The plane through the lines' points on the board (`planar_lines.sheet_by_points`)."""
    line = views.line
    lines, view, face = _numbered(views)

    def place(sights: Sights) -> ControlledSheet:
        normal, offset = faces_in_space(board, sights.poses, view, face)
        return sheet_by_points(sights.line_xy, lines, np.column_stack([normal, offset]))

    none = np.zeros((len(line), 0), dtype=int)
    sights = Sights(camera, poses, line.uv, _known_uv(views, line.view, none))
    return ControlForm(place, sights, line.view, lines, none, lines, by_pixel=True)


def cross_ratios(board: Board, views: BoardViews, camera: Camera, poses: Array) -> ControlForm:
    """The plane through the crossings of the line of light with lines of known points
    (`cross_ratio.cross_ratio_sheet`).

    Raises
    ------
    UntrustworthyError
        If no face of the board has three known points on one line.
    """
    lines, view, face = _numbered(views)
    on_face = [printed_lines(board, number) for number in range(len(board.faces))]
    if not any(len(own) for own in on_face):
        raise UntrustworthyError(
            "board",
            "no face of the body has three known points on one straight line",
            "use --method zigzag, planar-lines or joint",
        )
    line = np.repeat(np.arange(len(view)), [len(on_face[number]) for number in face])
    known = _padded([own for number in face for own in on_face[number]])
    stripes = _Stripes(lines, len(view))

    whole = Sights(camera, poses, views.line.uv, _known_uv(views, view[line], known))
    places = board.points[known]
    own = cross_ratio_points(places, whole.known_xy, stripes.of(whole)[line])
    crossed = _between(own, places, _BEYOND)
    crossed &= _lit(placed(own, poses[view[line]]), line, whole.line_xy, lines)
    line, known, places = line[crossed], known[crossed], places[crossed]

    def place(sights: Sights) -> ControlledSheet:
        light, pose = stripes.of(sights)[line], sights.poses[view[line]]
        return cross_ratio_sheet(places, sights.known_xy, light, pose)

    sights = replace(whole, known_uv=whole.known_uv[crossed])
    return ControlForm(place, sights, view[line], line, known, lines)


def zigzag(board: Board, views: BoardViews, camera: Camera, poses: Array) -> ControlForm:
    """The plane through the spots where lines of light meet ridges, by the lines on the faces to
    both sides (`zigzag.zigzag_sheet_of_stripes`). As the faces, the ridges are taken to be where
    they are said to be, however far the points printed on them are off.

    Raises
    ------
    UntrustworthyError
        If the target has no two faces with an edge in common.
    """
    between = ridges(board) if isinstance(board, SolidTarget) else []
    if not between:
        raise UntrustworthyError(
            "board",
            "no two faces of the target have two of its points in common, so that it has no ridge",
            "use --method planar-lines, cross-ratio or joint; for a zigzag target name the points "
            "of each ridge in both faces, under [board] in rig.toml",
        )
    lines, view, face = _numbered(views)
    stripes = _Stripes(lines, len(view))
    beside = [(n, ends) for n, own in enumerate(face) for faces, ends in between if own in faces]
    line = np.array([n for n, _ in beside], dtype=int)
    known = np.array([ends for _, ends in beside], dtype=int).reshape(-1, 2)

    none = _known_uv(views, view[line], known[:, :0])
    sights = Sights(camera, poses, views.line.uv, none)
    pose, edges = poses[view[line]], board.points[known]
    points = stripes_on_ridges(stripes.of(sights)[line], placed(edges, pose))
    met = _between(np.einsum("kji,kj->ki", pose[:, :, :3], points - pose[:, :, 3]), edges)
    line, known, edges = line[met], known[met], edges[met]
    _require_spots(len(set(zip(view[line], *known.T, strict=True))))

    def place(sights: Sights) -> ControlledSheet:
        spots = stripes.of(sights)[line]
        return zigzag_sheet_of_stripes(spots, edges, sights.poses[view[line]])

    sights = replace(sights, known_uv=none[met])
    return ControlForm(place, sights, view[line], line, known[:, :0], lines)


def _require_spots(count: int) -> None:
    """Two spots, each found from both sides, would pass for four points of a plane."""
    if count < _FEWEST_SPOTS:
        raise UntrustworthyError(
            "plane",
            f"the light was seen to cross ridges in {count} places, at least {_FEWEST_SPOTS} are "
            "needed",
            "take further views with the line across the ridges, nearer and farther",
        )


FORMS: Mapping[str, ControlFormOf] = {
    "planar-lines": planar_lines,
    "cross-ratio": cross_ratios,
    "zigzag": zigzag,
}
"""The closed forms by the name of their method."""


class _Stripes:
    """The lines of light through their pixels, kept as long as camera and pixels are the same:
    of the changes that errors are followed through, most leave them alone.

    Parameters
    ----------
    lines : (P,) int array
        The line that each pixel belongs to.
    count : int
    """

    def __init__(self, lines: np.ndarray, count: int) -> None:
        self._lines, self._count = lines, count
        self._seen: tuple[Camera, Array] | None = None
        self._found = np.zeros((0, 3))

    def of(self, sights: Sights) -> Array:
        """``(L, 3)``: ``ℓ`` with ``ℓ · (x, y, 1) = 0``."""
        seen = self._seen
        if seen is None or seen[0] is not sights.camera or seen[1] is not sights.line_uv:
            self._seen = (sights.camera, sights.line_uv)
            self._found = image_lines(sights.line_xy, self._lines, self._count)
        return self._found


def _numbered(views: BoardViews) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The number of each pixel's line ``(P,)``, and of each line its view and face."""
    groups = views.line.groups()
    lines = np.zeros(len(views.line), dtype=int)
    for number, own in enumerate(groups):
        lines[own] = number
    first = np.array([own[0] for own in groups], dtype=int)
    return lines, views.line.view[first], views.line.face[first]


def _known_uv(views: BoardViews, view: np.ndarray, known: np.ndarray) -> Array:
    """Image points ``(K, J, 2)`` of the target's points, NaN for the repetitions that fill a
    row."""
    uv = views.uv[view[:, None], known]
    again = np.zeros(known.shape, dtype=bool)
    again[:, 1:] = known[:, 1:] == known[:, :-1]
    uv[again] = np.nan
    return uv


def _padded(rows: list[np.ndarray]) -> np.ndarray:
    """Rows of one length, each filled up with its last number."""
    length = max((len(row) for row in rows), default=3)
    filled = [np.append(row, np.full(length - len(row), row[-1])) for row in rows]
    return np.array(filled, dtype=int).reshape(-1, length)


def _between(points: Array, known: Array, room: float = _BESIDE) -> np.ndarray:
    """Mask ``(K,)`` of points that lie between the known points ``(K, J, 3)`` of their line, or
    no further beyond them than a part of its length."""
    low, high = known.min(axis=1), known.max(axis=1)
    reach = room * np.linalg.norm(high - low, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.asarray(((points >= low - reach) & (points <= high + reach)).all(axis=1))


def _lit(points: Array, line: np.ndarray, xy: Array, lines: np.ndarray) -> np.ndarray:
    """Mask ``(K,)`` of points in space whose picture lies within that stretch of their line of
    light which was seen."""
    lit = np.zeros(len(points), dtype=bool)
    for number in np.unique(line):
        own = xy[lines == number]
        middle = own.mean(axis=0)
        way = np.linalg.svd(own - middle, full_matrices=False)[2][0]
        along = (own - middle) @ way
        room = _BESIDE * np.ptp(along)
        these = np.flatnonzero(line == number)
        place = (points[these, :2] / points[these, 2:] - middle) @ way
        with np.errstate(invalid="ignore"):
            lit[these] = (place >= along.min() - room) & (place <= along.max() + room)
    return lit
