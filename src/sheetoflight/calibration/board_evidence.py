"""Boards, and the lines of light on them, as a part of the adjustment.

A view's own parameters are its pose: a turn ω and a shift of the board's origin. The points of the
board see the camera and the pose; the lines (`lines_on_boards`) see the sheets too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sheetoflight.calibration.components import CORNER, LINE, SHAPE, STRIPE
from sheetoflight.calibration.lines_on_boards import (
    RAY,
    LineRows,
    ReducedLines,
    free_parts,
    line_rows,
    off_sheet_patterns,
    reduced_lines,
)
from sheetoflight.calibration.rig_state import (
    CAMERA,
    LOCAL_SIZE,
    RigState,
    bend_names,
    sheet_names,
)
from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.estimation.variance_components import Contrasts, compressed, contrasts
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews, proportions

_POSE = LOCAL_SIZE["board"]

_PARTS = 2
"""Free parts of a line: its turn and its offset."""

_SIGNIFICANT = 1e-8
"""Strength of a direction, as a part of the strongest, below which it is rounding."""


@dataclass(frozen=True, eq=False)
class BoardEvidence:
    """The views of stage board, ready to be adjusted.

    Parameters
    ----------
    board : Board
    views : BoardViews
    variances : (7,) array
        Of the `COMPONENTS`.
    lines : ReducedLines or None
        None where there is no sheet to adjust.
    whitener : (L, q, 17) array, optional
        W with ``WᵀW = V⁻¹``, V being the covariance of the lines' rows.
    """

    board: Board
    views: BoardViews
    variances: Array
    lines: ReducedLines | None = None
    whitener: Array | None = None

    @classmethod
    def at(
        cls, board: Board, views: BoardViews, variances: Array, state: RigState
    ) -> BoardEvidence:
        """The views with their lines reduced and weighed at a state."""
        if not len(views.line) or not len(state.distances):
            return cls(board, views, variances)
        lines = reduced_lines(views.line, state.camera)
        rows = line_rows(lines, board, state)
        whole = state.bends is not None or not variances[SHAPE]
        whitener = _whitener(lines, rows, variances, whole)
        return cls(board, views, variances, lines, whitener)

    @cached_property
    def proportions(self) -> Array:
        """``(N, M)``: of the points' standard uncertainties."""
        return proportions(self.views.stds)[0]

    @property
    def corner_std(self) -> float:
        """Standard uncertainty of a typical point's image coordinate, px."""
        return float(np.sqrt(self.variances[CORNER]))

    @property
    def observed(self) -> int:
        """Number of image coordinates of points, and of points of lines."""
        lines = 0 if self.lines is None else int(self.lines.counts.sum())
        return 2 * int(self.views.seen.sum()) + lines

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less the poses' parameters."""
        return self.observed - _POSE * len(self.views)

    @cached_property
    def _slots(self) -> int:
        """The most lines that a view has."""
        none = self.lines is None or not len(self.lines)
        return 0 if none else int(self.lines.slot.max()) + 1  # pyright: ignore[reportOptionalMemberAccess]

    def columns(self, parameters: Sequence[str], state: RigState) -> np.ndarray:
        """Which of all shared parameters move the residuals: the camera's, then the sheets'."""
        count = len(state.distances) if self.lines is not None else 0
        names = (*CAMERA, *sheet_names(count), *bend_names(count))
        return np.array([parameters.index(n) for n in names if n in parameters], dtype=int)

    def errors(self, state: RigState) -> Array:
        """Observed minus predicted image points ``(N, M, 2)``, px; NaN where not seen."""
        return self.views.uv - state.camera.project(self.points(state))

    def points(self, state: RigState) -> Array:
        """The board's points ``(N, M, 3)`` in the camera frame, mm."""
        pose = state.poses["board"]
        return self.board.points @ np.swapaxes(pose[:, :, :3], 1, 2) + pose[:, None, :, 3]

    def block(self, state: RigState, parameters: Sequence[str]) -> Block:
        """Whitened residuals, predicted minus observed, and their derivatives by the pose and by
        those shared parameters that are to be estimated."""
        weights = self._weights / np.sqrt(self.variances[CORNER])
        corners = _weighted(self.corner_block(state, parameters), weights)
        if self.lines is None or self.whitener is None:
            return corners
        rows = line_rows(self.lines, self.board, state)
        lines = self._line_block(
            state, parameters, rows, self._pulls(parameters, rows.turns), rows.misses, rows.by_bend
        )
        lines = Block(
            (self.whitener @ lines.residuals[..., None])[..., 0],
            self.whitener @ lines.by_shared,
            lines.columns,
            self.whitener @ lines.by_local,
        )
        return self._stacked(corners, lines)

    @cached_property
    def _weights(self) -> Array:
        """``(N, 2M)``: one over the points' proportions, 0 where not seen."""
        return np.repeat(np.where(self.views.seen, 1.0 / self.proportions, 0.0), 2, axis=1)

    def corner_block(
        self, state: RigState, parameters: Sequence[str], size_column: int | None = None
    ) -> Block:
        """Residuals of the board's points in px, not weighted, 0 where not seen; with the board's
        relative size as a further column where wanted."""
        pose = state.poses["board"]
        turned = self.board.points @ np.swapaxes(pose[:, :, :3], 1, 2)
        intrinsics = [i for i, name in enumerate(CAMERA) if name in parameters]
        uv, by_point, by_camera = state.camera.project_with_jacobians(
            turned + pose[:, None, :, 3], intrinsics
        )
        count, markers = uv.shape[:2]
        rows = (count, 2 * markers)
        by_local = np.empty((*uv.shape, _POSE))
        by_local[..., 3:] = by_point
        for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):  # ω × X, row by row
            by_local[..., k] = turned[..., None, i] * by_point[..., j]
            by_local[..., k] -= turned[..., None, j] * by_point[..., i]
        columns = [parameters.index(CAMERA[i]) for i in intrinsics]
        shared = [by_camera]
        if size_column is not None:
            shared.append(by_point @ turned[..., None])
            columns.append(size_column)
        block = Block(
            (uv - self.views.uv).reshape(rows),
            np.concatenate(shared, axis=-1).reshape(*rows, -1),
            np.array(columns, dtype=int),
            by_local.reshape(*rows, _POSE),
        )
        return block if self.views.seen.all() else _silenced(block, self.views.seen)

    def _pulls(self, parameters: Sequence[str], turns: Array) -> Array:
        """``(L, 17, 2 + f)``: how the reduced rows move with a line's two free parts, and with
        the f free parameters of the camera."""
        assert self.lines is not None
        roots = self.lines.roots
        by_camera = roots[:, :, [RAY + i for i, name in enumerate(CAMERA) if name in parameters]]
        return np.concatenate([roots[:, :, :RAY] @ turns, by_camera], axis=2)

    def _line_block(
        self,
        state: RigState,
        parameters: Sequence[str],
        rows: LineRows,
        pulls: Array,
        misses: Array,
        by_bend: Array | None,
    ) -> Block:
        """Residuals of the lines, one group a line, in units of the points' proportions."""
        assert self.lines is not None
        count = len(state.distances)
        parts = pulls[:, :, :_PARTS]
        shared = [pulls[:, :, _PARTS:]]
        moves = ((sheet_names(count), parts @ rows.by_sheet), (bend_names(count), by_bend))
        for names, values in moves:
            free = [i for i, name in enumerate(names) if name in parameters]
            if free and values is not None:
                shared.append(self._of_own_sheet(values, count)[..., free])
        return Block(
            misses,
            np.concatenate(shared, axis=2),
            self.columns(parameters, state),
            parts @ rows.by_pose,
        )

    def _of_own_sheet(self, values: Array, count: int) -> Array:
        """Derivatives ``(L, q, 3)`` by what each line's sheet has three of, in the columns of its
        sheet ``(L, q, 3 S)``."""
        assert self.lines is not None
        own = np.zeros((*values.shape[:2], 3 * count))
        for k in range(3):
            own[np.arange(len(own)), :, 3 * self.lines.laser + k] = values[..., k]
        return own

    def contrasts(
        self,
        state: RigState,
        parameters: Sequence[str],
        offsets: Sequence[int] = (),
        size_column: int | None = None,
    ) -> Contrasts:
        """The residuals with the poses eliminated, the many compressed to what they say.

        Parameters
        ----------
        state : RigState
        parameters : sequence of str
        offsets : sequence of int
            Which of the components LINE and SHAPE disturb the lines.
        size_column : int, optional
            Which column the relative size of the boards is to be, where it is wanted.
        """
        corners, rest = self._compressed_corners(state, parameters, size_column)
        told = ((CORNER, *rest),)
        count, own = corners.residuals.shape
        if self.lines is None:
            parts = [(CORNER, np.broadcast_to(np.eye(own), (count, own, own)))]
            return contrasts(corners, parts, np.ones((count, own), dtype=bool), told)
        lines, patterns, line_rest = self._compressed_lines(
            state, parameters, size_column, SHAPE in offsets
        )
        whole = self._stacked(corners, lines)
        size = whole.residuals.shape[1]
        corner = np.broadcast_to(np.diag(np.arange(size) < own).astype(float), (count, size, size))
        parts = [(CORNER, corner)]
        for component in (STRIPE, *offsets):
            pattern = patterns[component]
            spread = np.zeros((count, size, size))
            spread[:, own:, own:] = self._own_slots(pattern @ np.swapaxes(pattern, 1, 2))
            parts.append((component, spread))
        there = np.einsum("nii->ni", corner + parts[1][1]) > 0
        return contrasts(whole, parts, there, (*told, (STRIPE, *line_rest)))

    def _compressed_corners(
        self, state: RigState, parameters: Sequence[str], size_column: int | None
    ) -> tuple[Block, tuple[float, int]]:
        """The points' residuals in units of their proportions, compressed; and what is left."""
        part = self.corner_block(state, parameters, size_column)
        part = _weighted(part, self._weights)
        width = part.by_shared.shape[2]
        design = np.concatenate([part.by_shared, part.by_local], axis=2)
        design, residuals, rest = compressed(design, part.residuals)
        block = Block(residuals, design[..., :width], part.columns, design[..., width:])
        left = 2 * int(self.views.seen.sum()) - residuals.size
        return block, (float(rest.sum()), left)

    def _compressed_lines(
        self,
        state: RigState,
        parameters: Sequence[str],
        size_column: int | None,
        windings: bool,
    ) -> tuple[Block, dict[int, Array], tuple[float, int]]:
        """The lines' residuals in as few directions as they need, one group a line; what single
        points do to these ``(L, q, q)``, ends off the sheet ``(L, q, 2)`` and windings
        ``(L, q, 4)``; and the sum of squares and the number of what is left."""
        assert self.lines is not None
        rows = line_rows(self.lines, self.board, state)
        # the turn about the fitted line: about another, it would bring in the points' scatter
        pulls = self._pulls(parameters, free_parts(self.lines.lines))
        basis = _significant(np.concatenate([pulls, self.lines.shapes], axis=2))
        along = np.einsum("lqk,lq->lk", basis, rows.misses)
        rest = float(np.sum(rows.misses**2) - np.sum(along**2))
        left = int(self.lines.counts.sum() - np.sum(basis**2))
        if self.variances[SHAPE] and not windings:  # only turn and offset say anything
            basis = np.linalg.qr(pulls[:, :, :_PARTS])[0]
        turned = np.swapaxes(basis, 1, 2)
        pulls, misses = turned @ pulls, (turned @ rows.misses[..., None])[..., 0]
        by_bend = None if rows.by_bend is None else turned @ rows.by_bend
        block = self._line_block(state, parameters, rows, pulls, misses, by_bend)
        parts = pulls[:, :, :_PARTS]
        if size_column is not None:
            columns = np.append(block.columns, size_column)
            by_shared = np.concatenate([block.by_shared, parts @ rows.by_size], axis=2)
            block = Block(block.residuals, by_shared, columns, block.by_local)
        patterns = {
            STRIPE: turned @ basis,
            LINE: parts @ off_sheet_patterns(self.lines, rows),
            SHAPE: turned @ self.lines.shapes,
        }
        return block, patterns, (max(rest, 0.0), left)

    def _stacked(self, corners: Block, lines: Block) -> Block:
        """Points and lines of each view, one below the other."""
        count, own = corners.residuals.shape
        by_shared = np.zeros((count, own, len(lines.columns)))
        place = [lines.columns.tolist().index(column) for column in corners.columns]
        by_shared[..., place] = corners.by_shared
        below = [
            self._by_view(values).reshape(count, self._slots * lines.residuals.shape[1], -1)
            for values in (lines.residuals[..., None], lines.by_shared, lines.by_local)
        ]
        return Block(
            np.concatenate([corners.residuals, below[0][..., 0]], axis=1),
            np.concatenate([by_shared, below[1]], axis=1),
            lines.columns,
            np.concatenate([corners.by_local, below[2]], axis=1),
        )

    def _own_slots(self, values: Array) -> Array:
        """Matrices of lines ``(L, q, q)`` on the diagonal of their views' ``(N, G q, G q)``."""
        assert self.lines is not None
        size, slots = values.shape[1], self._slots
        spread = np.zeros((len(self.views), slots, size, slots, size))
        spread[self.lines.view, self.lines.slot, :, self.lines.slot] = values
        return spread.reshape(len(self.views), slots * size, slots * size)

    def _by_view(self, values: Array) -> Array:
        """Rows of lines ``(L, q, k)`` put into the slots of their views ``(N, G, q, k)``."""
        assert self.lines is not None
        spread = np.zeros((len(self.views), self._slots, *values.shape[1:]))
        spread[self.lines.view, self.lines.slot] = values
        return spread


def _weighted(block: Block, weights: Array) -> Block:
    return Block(
        block.residuals * weights,
        block.by_shared * weights[..., None],
        block.columns,
        block.by_local * weights[..., None],
    )


def _silenced(block: Block, seen: np.ndarray) -> Block:
    """A block in which points that were not seen say nothing."""
    hidden = np.repeat(~seen, 2, axis=1)
    return Block(
        np.where(hidden, 0.0, block.residuals),
        np.where(hidden[..., None], 0.0, block.by_shared),
        block.columns,
        np.where(hidden[..., None], 0.0, block.by_local),
    )


def _whitener(lines: ReducedLines, rows: LineRows, variances: Array, whole: bool) -> Array:
    """``(L, q, 17)``: W with ``WᵀW = (θ_stripe I + θ_line T Tᵀ + θ_shape S Sᵀ)⁻¹``, T being what a
    line's ends off the sheet do to its rows, and S windings. Where not the whole line counts, only
    turn and offset say anything: q is 2 in place of 17."""
    size = lines.roots.shape[-1]
    parts = lines.roots[:, :, :RAY] @ rows.turns
    basis = np.eye(size) if whole else np.linalg.qr(parts)[0]
    kept = np.swapaxes(basis, -1, -2)
    winding = variances[SHAPE] if whole else 0.0
    if not variances[LINE] and not winding:
        whitener = kept / np.sqrt(variances[STRIPE])
        return np.broadcast_to(whitener, (len(lines), *whitener.shape[-2:]))
    covariance = variances[STRIPE] * np.eye(kept.shape[-2])
    for variance, moved in (
        (variances[LINE], parts @ off_sheet_patterns(lines, rows)),
        (winding, lines.shapes),
    ):
        if variance:
            own = kept @ moved
            covariance = covariance + variance * own @ np.swapaxes(own, 1, 2)
    return np.linalg.inv(np.linalg.cholesky(covariance)) @ kept


def _significant(design: Array) -> Array:
    """Orthonormal directions ``(L, q, k)`` that columns ``(L, q, k)`` span, 0 for those that only
    rounding lets them reach: there lies the scatter of the line's points, all of it."""
    size = np.linalg.norm(design, axis=1, keepdims=True)
    basis, strength, _ = np.linalg.svd(design / np.where(size > 0, size, 1.0), full_matrices=False)
    return basis * (strength > _SIGNIFICANT * strength[:, :1])[:, None, :]
