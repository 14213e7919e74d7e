"""Boards simulated again from the result of their calibration.

The truth of a trial is where the calibration has every board, and its sheets of light. A point of
a line lies where its ray meets the face, moved straight into the sheet. Drawn anew are the noise
of the points; how far the board's points lie from where they should, one draw for all views; the
board's size; and of every line the noise of its points, how far its two ends lie off the sheet,
and how it winds (docs/uncertainty.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander

from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.board_planes import faces_in_space, on_faces
from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.components import COMPONENTS, SHAPE
from sheetoflight.calibration.lines_on_boards import SHAPES
from sheetoflight.calibration.printed_points import print_errors
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.screening import screened
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.rig import Rig


@dataclass(frozen=True, eq=False)
class TrueLines:
    """Points of lines of light as they were, were the calibration exact.

    Parameters
    ----------
    points : (P, 3) array
        mm, camera frame.
    along : (P, 3) array
        Unit vectors along the lines.
    lift : (P, 3) array
        How a point moves on its face when the light comes from 1 mm above the sheet.
    growth : (P, 3) array
        How it moves in its sheet with the relative size of the board, mm.
    place : (P,) array
        Where it lies on its line in space, 0 at one end and 1 at the other.
    windings : (P, 4) array
        What unit windings of each degree move it by, px.
    proportions : (P,) array
        Of the standard uncertainties across the lines.
    number : (P,) int array
        Of its line.
    """

    points: Array
    along: Array
    lift: Array
    growth: Array
    place: Array
    windings: Array
    proportions: Array
    number: np.ndarray

    def drawn(
        self,
        camera: Camera,
        sizes: Mapping[str, float],
        size: float,
        rng: np.random.Generator,
    ) -> Array:
        """Image points ``(P, 2)`` as they might have been seen as well, px.

        Parameters
        ----------
        camera : Camera
        sizes : mapping from noise component to float
            ``stripe`` and ``shape`` in px, ``line`` in mm.
        size : float
            By how much the board is larger than it is said to be.
        rng : numpy.random.Generator
        """
        count = int(self.number.max(initial=-1)) + 1
        ends = sizes["line"] * rng.standard_normal((count, 2))[self.number]
        off = ends[:, 0] * (1.0 - self.place) + ends[:, 1] * self.place
        points = self.points + off[:, None] * self.lift + size * self.growth
        uv, by_point, _ = camera.project_with_jacobians(points, ())
        way = normalised((by_point @ self.along[..., None])[..., 0])
        across = np.stack([-way[:, 1], way[:, 0]], axis=1)
        windings = sizes["shape"] * rng.standard_normal((count, len(SHAPES)))[self.number]
        single = sizes["stripe"] * self.proportions * rng.standard_normal(len(uv))
        miss = single + np.sum(windings * self.windings, axis=1)
        return uv + miss[:, None] * across


@dataclass(frozen=True, eq=False)
class TrueBoards:
    """Stage board as it was, were the calibration exact.

    Parameters
    ----------
    board : Board
    views : BoardViews
        As the calibration used them.
    poses : (N, 3, 4) array
        ``[R t]``, camera_from_board, t in mm.
    std : (N, M) array
        Standard deviation of each image coordinate of the board's points, px.
    printed_mm : (3,) array
        Standard deviations of the points' places along the board's axes, mm.
    lines : TrueLines or None
        None where there is no line.
    """

    board: Board
    views: BoardViews
    poses: Array
    std: Array
    printed_mm: Array
    lines: TrueLines | None

    def drawn(
        self, camera: Camera, sizes: Mapping[str, float], rng: np.random.Generator
    ) -> BoardViews:
        """The views as they might have been as well; ``sizes`` by noise component."""
        size = self.board.scale_std * rng.standard_normal()
        offsets = self.printed_mm * rng.standard_normal(self.board.points.shape)
        points = self.board.points * (1.0 + size) + offsets
        uv = camera.project(_placed(points, self.poses))
        uv = uv + self.std[..., None] * rng.standard_normal(uv.shape)
        line = self.views.line
        if self.lines is not None:
            line = replace(line, uv=self.lines.drawn(camera, sizes, size, rng))
        return replace(self.views, uv=uv, line=line).without(~self.views.seen)


def true_boards(
    board: Board, views: BoardViews, calibration: Calibration, sizes: Mapping[str, float]
) -> TrueBoards:
    """What is needed to simulate the boards of a calibrated rig again.

    Parameters
    ----------
    board : Board
    views : BoardViews
        Without what the calibration left out.
    calibration : Calibration
    sizes : mapping from noise component to float
    """
    placed = {v.view: v.xyz for v in calibration.residuals.views if v.stage == "board"}
    poses = _poses(board.points, np.array([placed[name] for name in views.names]))
    evidence = BoardEvidence(board, views, np.zeros(len(COMPONENTS)))
    shown = _shown(evidence, calibration.camera, poses)
    printed = shown if board.tolerance_mm is None else np.full(3, board.tolerance_mm)
    common = _common_px2(evidence, calibration.camera, poses, shown) if printed.any() else 0.0
    corner = np.sqrt(max(sizes["corner"] ** 2 - common, 0.0))
    return TrueBoards(
        board,
        views,
        poses,
        corner * evidence.proportions,
        printed,
        _true_lines(board, views.line, poses, calibration) if len(views.line) else None,
    )


def winding_px(rig: Rig) -> float:
    """How far the lines of a rig wind, px, each degree of Legendre's polynomials by itself.

    Windings disturb no estimate, since of lines that wind nothing else is used than place and
    direction. So the joint fit knows them, and a calibration does not hold them.
    """
    if not len(rig.observations.board.line):
        return 0.0
    boards = screened_boards(rig)
    fit = screened(boards.rig, boards.state).fit
    return 0.0 if fit is None else float(np.sqrt(fit.noise.variances[SHAPE]))


def _placed(points: Array, poses: Array) -> Array:
    """Points ``(N, M, 3)`` in the camera frame, of ``(M, 3)`` in the board's, mm."""
    return points @ np.swapaxes(poses[:, :, :3], 1, 2) + poses[:, None, :, 3]


def _poses(points: Array, placed: Array) -> Array:
    """``[R t]`` ``(N, 3, 4)`` that takes points ``(M, 3)`` to places ``(N, M, 3)`` (Kabsch, Acta
    Crystallographica A32, 1976)."""
    middle, middles = points.mean(axis=0), placed.mean(axis=1)
    u, _, vt = np.linalg.svd(np.swapaxes(placed - middles[:, None], 1, 2) @ (points - middle))
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    turns = u @ vt
    return np.concatenate([turns, (middles - turns @ middle)[..., None]], axis=2)


def _shown(evidence: BoardEvidence, camera: Camera, poses: Array) -> Array:
    """Standard deviations ``(3,)`` of the points' places that the residuals show, mm."""
    state = RigState(camera, np.zeros(3), np.zeros((0, 3, 3)), np.zeros(0), {"board": poses})
    found = print_errors(evidence, state)
    return np.array([found.in_plane_mm, found.in_plane_mm, found.out_of_plane_mm])


def _common_px2(evidence: BoardEvidence, camera: Camera, poses: Array, shown: Array) -> float:
    """What the points' places add to the variance of the residuals, px²: the estimated noise of
    the points has it already."""
    _, by_point, _ = camera.project_with_jacobians(_placed(evidence.board.points, poses), ())
    moved = by_point @ poses[:, None, :, :3] * shown / evidence.proportions[..., None, None]
    return float(np.mean(np.sum(moved[evidence.views.seen] ** 2, axis=-1)))


def _true_lines(
    board: Board, line: LinePixels, poses: Array, calibration: Calibration
) -> TrueLines:
    """The lines' points on their faces and in their sheets."""
    sheets = np.array([[*p.normal, p.distance_mm] for p in calibration.light_planes])
    n, d = sheets[line.laser, :3], sheets[line.laser, 3]
    m, c = faces_in_space(board, poses, line.view, line.face)
    cosine = _dot(n, m)[:, None]
    along, sine2 = normalised(np.cross(n, m)), 1.0 - cosine**2
    up = (n - cosine * m) / sine2
    points, number = on_faces(calibration.camera.unproject(line.uv), m, c), _numbers(line)
    for laser, sheet in enumerate(calibration.light_planes):
        own = line.laser == laser
        points[own] += sheet.along(points[own], up[own])[:, None] * up[own]
    pictured = normalised(np.cross(c[:, None] * n - d[:, None] * m, [0.0, 0.0, 1.0]))
    return TrueLines(
        points=points,
        along=along,
        lift=up,
        growth=(m - cosine * n) * (board.faces[line.face, 3:] / sine2),
        place=_share(_dot(points, along), number),
        windings=_windings(2.0 * _share(_dot(points / points[:, 2:], pictured), number) - 1.0),
        proportions=line.proportions,
        number=number,
    )


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=1)


def _numbers(line: LinePixels) -> np.ndarray:
    """``(P,)``: to which line each point belongs."""
    number = np.zeros(len(line), dtype=int)
    for k, own in enumerate(line.groups()):
        number[own] = k
    return number


def _share(way: Array, number: np.ndarray) -> Array:
    """Places ``(P,)`` along lines, from 0 at one end of each to 1 at the other."""
    count = int(number.max(initial=-1)) + 1
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, number, way)
    np.maximum.at(high, number, way)
    return (way - low[number]) / np.maximum(high - low, 1e-300)[number]


def _windings(along: Array) -> Array:
    """``(P, 4)``: Legendre's polynomials at places from −1 to 1, each of unit mean square."""
    return legvander(along, max(SHAPES))[:, SHAPES] * np.sqrt(2 * np.array(SHAPES) + 1)
