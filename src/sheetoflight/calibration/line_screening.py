"""What of the lines on boards is light of the sheet: cut into pieces, what lies off the board or in
no sheet with the others is left out.

In three steps: what goes on from the board's pattern, what forms a straight line, and what lies
in the sheet of most (`line_consensus`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_planes import faces_in_space, on_faces
from sheetoflight.calibration.line_consensus import FacePlanes, agreed_pieces
from sheetoflight.calibration.lines_on_boards import reduced_lines
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.straight_pieces import Piece, cut_into_pieces, grown, whole_lines
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.rig import Rig

_PLENTY = 15
"""Points of a line on the pattern that tell which way it goes on beside it."""

_ON_EDGE = 0.1
"""Distance from a line of the pattern, in pitches, within which a line runs along it."""

_ENOUGH = 200
"""Points that tell where a line runs, as well as more do."""

_SHOWN = 5
"""Names that are listed one by one."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """The points of all lines.

    Parameters
    ----------
    board : Board
    line : LinePixels
    poses : (N, 3, 4) array
        Of the boards.
    rays, points : (P, 3) arrays
        In the camera frame, and where they meet the boards, in the boards' frames, mm.
    printed : (P,) mask
        Whether that is on the pattern.
    focal : float
        px per unit of normalised coordinates.
    views : int
        How many there are, with a line or without.
    """

    board: Board
    line: LinePixels
    poses: Array
    rays: Array
    points: Array
    printed: np.ndarray
    focal: float
    views: int

    @classmethod
    def at(cls, rig: Rig, state: RigState) -> _Seen:
        """At a camera and poses that fit the boards' points."""
        assert rig.board is not None
        line, poses = rig.observations.board.line, state.poses["board"]
        rays = state.camera.unproject(line.uv)
        points = _in_board_frames(rig.board, line, poses, rays)
        printed = _on_printed_part(rig.board, line.face, points)
        focal = 0.5 * (state.camera.alpha + state.camera.beta)
        return cls(rig.board, line, poses, rays, points, printed, focal, len(poses))


def screened_lines(rig: Rig, state: RigState) -> tuple[LinePixels, tuple[str, ...]]:
    """Those parts of the lines that lie on the boards and in one sheet for each laser.

    Parameters
    ----------
    rig : Rig
        With boards.
    state : RigState
        Camera and poses that fit the boards' points.

    Returns
    -------
    line : LinePixels
    wrong : tuple of str
        What was left out, in words.
    """
    views = rig.observations.board
    if not len(views.line):
        return views.line, ()
    seen = _Seen.at(rig, state)
    kept = np.zeros(len(views.line), dtype=bool)
    lost: list[str] = []
    edges: list[str] = []
    for laser in np.unique(views.line.laser):
        for own, points, on_edge in _in_one_sheet(seen, int(laser)):
            kept[points] = True
            if not len(points):
                (edges if on_edge else lost).append(views.names[views.line.view[own[0]]])
    left = views.line.take(kept)
    if len(left):  # the adjustment begins at this camera
        reduced_lines(left, state.camera, seen.rays[kept])
    return left, _in_words(lost, edges, bool(kept.any()))


def _in_one_sheet(seen: _Seen, laser: int) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """For each line of a laser the numbers of its points, of those that lie in the sheet of most,
    and whether it was left out for running along a line of the pattern."""
    lines = [own for own in seen.line.groups() if seen.line.laser[own[0]] == laser]
    images = [seen.focal * seen.rays[own, :2] for own in lines]
    whole = whole_lines(images, [seen.printed[own] for own in lines])
    # on its pattern the board is sure to be, beside it only the others can tell
    lines = [
        own if straight is not None else _from_the_pattern(own, image, seen.printed[own])
        for own, image, straight in zip(lines, images, whole, strict=True)
    ]
    cuts = cut_into_pieces(
        [seen.rays[own, :2] for own in lines],
        seen.focal,
        [seen.printed[own] for own in lines],
        whole,
    )
    pieces = [
        [
            _without_say(p) if _is_printed_edge(seen.board, seen.points[own[p.points]]) else p
            for p in cut
        ]
        for own, cut in zip(lines, cuts, strict=True)
    ]
    faces = FacePlanes(*_faces_of(seen.board, seen.line, lines, seen.poses))
    chosen = agreed_pieces(pieces, faces, seen.focal, seen.views)
    for own, cut, number in zip(lines, pieces, chosen, strict=True):
        points = own[:0] if number is None else own[cut[number].points]
        yield own, points, bool(cut) and not any(piece.weight for piece in cut)


def _without_say(piece: Piece) -> Piece:
    """An edge of the pattern: they agree on a sheet, for boards held alike; yet light may run
    along one."""
    return replace(piece, weight=0.0)


def _from_the_pattern(own: np.ndarray, points: Array, printed: np.ndarray) -> np.ndarray:
    """Those of a line's points that may lie on its board: all, or what goes on from its pattern."""
    return own[grown(points, printed)] if printed.sum() >= _PLENTY else own


def _is_printed_edge(board: Board, points: Array) -> bool:
    """Whether points ``(K, 3)`` of a line, in the board's frame, run along a line of its pattern:
    what a picture without laser light shows best."""
    if not isinstance(board, PlanarBoard):
        return False
    some = points[:: max(len(points) // _ENOUGH, 1), :2]
    places = np.sort(some / board.pitch_mm, axis=0)
    low, middle, high = places[(len(places) * np.array([0.05, 0.5, 0.95])).astype(int)]
    spread = high - low
    aligned = (np.abs(middle - np.rint(middle)) < _ON_EDGE) & (spread < 2.0 * _ON_EDGE)
    return bool((aligned & (spread[::-1] > 1.0)).any())


def _in_words(lost: list[str], edges: list[str], others: bool) -> tuple[str, ...]:
    """In words, the lines of views that are left out, and those along lines of the pattern."""
    along = "along the board's own rows or columns"
    if others:
        told = "the line{s} of {views} of stage board ({reason})"
        beside = "not in the others' sheet"
        along += ", whose edges pull at light and look like it – lay the line askew to the squares"
    else:
        told = "what looks like a line in {views} of stage board ({reason})"
        beside = "in no common sheet: right if the laser was off"
        along += ": right if the laser was off, else lay the line askew to the squares"
    return tuple(
        told.format(s="s" * (len(set(names)) > 1), views=_views(names), reason=reason)
        for names, reason in ((lost, beside), (edges, along))
        if names
    )


def _views(names: list[str]) -> str:
    each = sorted(set(names))
    more = f" and {len(each) - _SHOWN} more" if len(each) > _SHOWN else ""
    return f"view{'s' * (len(each) > 1)} {', '.join(each[:_SHOWN])}{more}"


def _faces_of(
    board: Board, line: LinePixels, groups: list[np.ndarray], poses: Array
) -> tuple[Array, Array]:
    """The planes of the faces on which lines lie; see `faces_in_space`."""
    firsts = np.array([own[0] for own in groups], dtype=int)
    return faces_in_space(board, poses, line.view[firsts], line.face[firsts])


def _in_board_frames(board: Board, line: LinePixels, poses: Array, rays: Array) -> Array:
    """Where the rays ``(P, 3)`` of lines meet their faces, in the frames of the boards, mm."""
    points, groups = np.empty_like(rays), line.groups()
    for own, normal, offset in zip(groups, *_faces_of(board, line, groups, poses), strict=True):
        pose = poses[line.view[own[0]]]
        there = on_faces(rays[None, own], normal[None], np.array([offset]))[0]
        points[own] = (there - pose[:, 3]) @ pose[:, :3]
    return points


def _on_printed_part(board: Board, face: np.ndarray, points: Array) -> np.ndarray:
    """Mask ``(P,)`` of lines' points, given in their boards' frames, that lie within one pitch
    of the pattern; of a solid body's faces, within the box about the face's points."""
    if isinstance(board, PlanarBoard):
        low, high = board.points.min(axis=0), board.points.max(axis=0)
        margin = np.array([*board.pitch_mm, np.inf])
        with np.errstate(invalid="ignore"):
            return np.asarray(((points > low - margin) & (points < high + margin)).all(axis=1))
    boxes = np.array(
        [
            (corners.min(axis=0), corners.max(axis=0))
            for corners in (board.points[list(face)] for face in board.face_points)
        ]
    )
    size = 1e-3 * float(np.ptp(board.points, axis=0).max())
    low, high = boxes[face, 0] - size, boxes[face, 1] + size
    with np.errstate(invalid="ignore"):
        return np.asarray(((points >= low) & (points <= high)).all(axis=1))
