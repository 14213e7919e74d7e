"""Recordings of boards with one deliberate fault.

Each function changes boards as they were placed; `photographed_boards` then shows what a person
would hand in who knows nothing of the fault.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board import Board, PlanarBoard, SolidTarget
from sheetoflight.simulation.board_lines import LinePoints, face_outlines, lines_on_faces
from sheetoflight.simulation.board_poses import placed_points
from sheetoflight.simulation.board_views import PlacedBoards
from sheetoflight.simulation.rig import SimulatedRig

_STEPS = 30
_TABLE_SIZE = 4.0
"""Size of the table behind a board, in outlines of the board."""


def scaled_board(board: Board, factor: float) -> Board:
    """The board with every length `factor` times as long: what is photographed where the board
    that is told is of the wrong size."""
    if isinstance(board, SolidTarget):
        return replace(board, points=factor * board.points)
    x, y = board.pitch_mm
    sizes = {
        name: factor * size
        for name in ("circle_mm", "marker_mm")
        if (size := getattr(board, name)) is not None
    }
    return replace(board, pitch_mm=(factor * x, factor * y), **sizes)


def bent_boards(
    rig: SimulatedRig,
    board: PlanarBoard,
    placed: PlacedBoards,
    bow_mm: float,
    turn_deg: float = 0.0,
) -> PlacedBoards:
    """The board is bent to a parabolic cylinder.

    Parameters
    ----------
    rig : SimulatedRig
    board : PlanarBoard
    placed : PlacedBoards
    bow_mm : float
        How far the middle of the board's points lies behind its outermost ones, seen along the
        direction of bending; below 0 before them.
    turn_deg : float
        The direction of bending, from the board's first axis towards its second.
    """
    bend = _Bend(board, bow_mm, np.radians(turn_deg))
    points = placed_points(bend.bent(board.points), placed.rotations, placed.translations)
    return replace(placed, points=points, line=_line_on_bent(rig, placed, bend))


def shifted_lines(board: Board, placed: PlacedBoards, offsets_mm: Array) -> PlacedBoards:
    """In every view the line lies elsewhere, across itself on the face, by ``(N,)`` mm."""
    line = placed.line
    turned = placed.rotations[line.view] @ board.faces[line.face, :3, None]
    across = np.cross(turned[..., 0], line.along)
    shift = np.asarray(offsets_mm, dtype=float)[line.view, None] * across
    return replace(placed, line=replace(line, points=line.points + shift))


def lines_beyond(
    rig: SimulatedRig,
    board: PlanarBoard,
    placed: PlacedBoards,
    gap_mm: float = 20.0,
    line_points: int = 300,
) -> PlacedBoards:
    """The lines go on beyond the board, on a table `gap_mm` behind it and parallel to it.

    The points are told to lie on the board's face. Up to `line_points` are added to a line:
    those that the board does not hide, evenly along its picture.
    """
    (outline,) = face_outlines(board)
    middle = outline.mean(axis=0)
    table = middle + _TABLE_SIZE * (outline - middle) + (0.0, 0.0, gap_mm)
    corners = placed_points(table, placed.rotations, placed.translations)
    more = lines_on_faces(rig, [corners], line_points)
    more = more.take(~_hidden(outline, placed, more))
    together = _joined(placed.line, more)
    order = np.argsort(together.view, kind="stable")
    return replace(placed, line=together.take(order))


class _Bend:
    """A parabolic cylinder through the outermost points of a board."""

    def __init__(self, board: PlanarBoard, bow_mm: float, turn: float) -> None:
        self._axis = np.array([np.cos(turn), np.sin(turn), 0.0])
        along = board.points @ self._axis
        self._middle, self._half = (along.min() + along.max()) / 2.0, np.ptp(along) / 2.0
        self._bow = bow_mm

    def bent(self, points: Array) -> Array:
        """Points ``(..., 3)`` of the bent board that lie over, or under, those of a flat one."""
        share = (points @ self._axis - self._middle) / self._half
        bent = points.copy()
        bent[..., 2] = self._bow * (1.0 - share**2)
        return bent


def _line_on_bent(rig: SimulatedRig, placed: PlacedBoards, bend: _Bend) -> LinePoints:
    """The lines where the sheets meet the bent board.

    Each point moves within the flat board, straight across the line, until the bent board's
    point over it lies in the sheet.
    """
    line = placed.line
    rotations, shifts = placed.rotations[line.view], placed.translations[line.view]
    normals = np.stack([sheet.normal for sheet in rig.light_planes])[line.laser]
    flat = _turned_back(rotations, line.points - shifts)
    across = _turned_back(rotations, normals)
    across[:, 2] = 0.0
    across /= np.sum(across**2, axis=1, keepdims=True)
    for _ in range(_STEPS):
        bent = _turned(rotations, bend.bent(flat)) + shifts
        flat = flat - rig.heights(bent, line.laser)[:, None] * across
    points = _turned(rotations, bend.bent(flat)) + shifts
    return replace(line, points=points)


def _turned(rotations: Array, vectors: Array) -> Array:
    return (rotations @ vectors[..., None])[..., 0]


def _turned_back(rotations: Array, vectors: Array) -> Array:
    return _turned(np.swapaxes(rotations, -1, -2), vectors)


def _hidden(outline: Array, placed: PlacedBoards, line: LinePoints) -> np.ndarray:
    """Mask of the points ``(P,)`` before which the board stands, seen from the camera."""
    rotations, shifts = placed.rotations[line.view], placed.translations[line.view]
    camera = _turned_back(rotations, -shifts)
    sight = normalised(_turned_back(rotations, line.points - shifts) - camera)
    met = camera - sight * (camera[:, 2:] / sight[:, 2:])
    low, high = outline.min(axis=0), outline.max(axis=0)
    return np.asarray(((met >= low) & (met <= high))[:, :2].all(axis=1))


def _joined(one: LinePoints, other: LinePoints) -> LinePoints:
    return LinePoints(
        np.concatenate([one.points, other.points]),
        np.concatenate([one.along, other.along]),
        np.concatenate([one.view, other.view]),
        np.concatenate([one.laser, other.laser]),
        np.concatenate([one.face, other.face]),
    )
