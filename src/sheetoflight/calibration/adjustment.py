"""The maximum-likelihood adjustment of camera, sheets of light and target poses.

One system holds every view of every stage. Shared parameters are the camera's intrinsics, the
fixed point of the pivoting target, and the sheets of light; each view adds its own pose. What
differs between the stages is data: where a pose puts the markers (`placements`), and how the
noise of a view's image points is correlated (`noise`). The rest – projection, weights, missing
markers – is common.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.placements import Placement, placed, placement_names
from sheetoflight.calibration.rig_state import CAMERA, LOCAL_SIZE, RigState
from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.observations import TargetViews


class Adjustment:
    """The least-squares problem of a set of stages, for `estimation.block_least_squares.solve`.

    Parameters
    ----------
    positions : (M,) array
        Marker positions along the target, mm.
    stages : mapping from stage to TargetViews
        Of the collinear target.
    std : mapping from stage to (N, M) array
        Standard uncertainty of each image coordinate, px.
    free : tuple of str
        The shared parameters to estimate, of `CAMERA`, `ANCHOR` and `sheet_names` in this order;
        all others are held. The poses of all views are always estimated.
    whiteners : mapping from stage to (N, 2 M, 2 M) array, optional
        For stages with correlated noise: ``W`` with ``WᵀW = Σ⁻¹``, in place of ``1/std``.
    boards : BoardEvidence, optional
        The views of stage board.
    """

    def __init__(
        self,
        positions: Array,
        stages: Mapping[str, TargetViews],
        std: Mapping[str, Array],
        free: tuple[str, ...],
        whiteners: Mapping[str, Array] | None = None,
        boards: BoardEvidence | None = None,
    ) -> None:
        self.positions = positions
        self.stages = dict(stages)
        self.std = dict(std)
        self.parameters = free
        self.whiteners = dict(whiteners or {})
        self.boards = boards
        self._intrinsics = [i for i, name in enumerate(CAMERA) if name in free]
        seen = {stage: views.seen for stage, views in self.stages.items()}
        self._weights = {
            stage: np.repeat(np.where(mask, 1.0 / std[stage], 0.0), 2, axis=1)
            for stage, mask in seen.items()
        }
        self._hidden = {stage: None if mask.all() else ~mask for stage, mask in seen.items()}

    @property
    def shared_size(self) -> int:
        """Number of shared parameters."""
        return len(self.parameters)

    @property
    def degrees_of_freedom(self) -> int:
        """Observed coordinates less estimated parameters."""
        observed = sum(2 * int(views.seen.sum()) for views in self.stages.values())
        local = sum(LOCAL_SIZE[stage] * len(views) for stage, views in self.stages.items())
        boards = 0 if self.boards is None else self.boards.degrees_of_freedom
        return observed + boards - local - self.shared_size

    @property
    def block_names(self) -> tuple[str, ...]:
        """The stage of each of `blocks`."""
        return (*self.stages, *(() if self.boards is None else ("board",)))

    def views_of(self, stage: str) -> TargetViews | BoardViews:
        """The views of a stage, of which boards are one."""
        return self.boards.views if stage == "board" and self.boards else self.stages[stage]

    def columns_of(self, names: Sequence[str]) -> np.ndarray:
        """Indices of shared parameters by name."""
        return np.array([self.parameters.index(name) for name in names], dtype=int)

    def blocks(self, state: RigState) -> list[Block]:
        """Whitened residuals (predicted minus observed) and their derivatives, by stage."""
        blocks = [self._whitened(stage, self.block(state, stage)) for stage in self.stages]
        if self.boards is not None:
            blocks.append(self.boards.block(state, self.parameters))
        return blocks

    def moved(self, state: RigState, shared: Array, local: Sequence[Array]) -> RigState:
        """The state after a step; unchanged where no such camera exists, so that there is no
        gain and the solver damps the step."""
        steps = dict(zip(self.parameters, shared.tolist(), strict=True))
        return state.moved(steps, dict(zip(self.block_names, local, strict=True))) or state

    def holds_at(self, state: RigState) -> bool:
        """Whether the lines, reduced where the adjustment began, are good for a state as well."""
        lines = None if self.boards is None else self.boards.lines
        return lines is None or lines.holds_for(state.camera)

    def placed(self, state: RigState, stage: str) -> Placement:
        """The points of one stage in space."""
        return placed(state, stage, self.positions, self.stages[stage])

    def residuals_px(self, state: RigState) -> dict[str, Array]:
        """Observed minus predicted image points ``(N, M, 2)`` by stage, of the boards their
        points; NaN where not seen."""
        residuals: dict[str, Array] = {
            stage: views.uv - state.camera.project(self.placed(state, stage).points)
            for stage, views in self.stages.items()
        }
        if self.boards is not None:
            residuals["board"] = self.boards.errors(state)
        return residuals

    def block(
        self, state: RigState, stage: str, moves: Sequence[Array] = (), own: Array | None = None
    ) -> Block:
        """Residuals of one stage in px, not whitened; 0 for markers that were not seen.

        Parameters
        ----------
        state : RigState
        stage : str
        moves : sequence of (N, M, 3) arrays
            Further ways in which the points could move, mm per unit each: columns of the block
            after all others, numbered on from `shared_size`.
        own : (N, M, 2, q) array, optional
            Further derivatives of the image points, px per unit, behind those.
        """
        views, place = self.stages[stage], self.placed(state, stage)
        free, columns = _free_columns(self.parameters, stage, len(state.distances))
        uv, by_point, by_camera = state.camera.project_with_jacobians(
            place.points, self._intrinsics
        )
        by_shared = [by_camera, by_point @ place.by_shared[..., free]]
        if moves:
            by_shared.append(by_point @ np.stack(moves, axis=-1))
        if own is not None:
            by_shared.append(own)
        count, markers = uv.shape[:2]
        extra = len(moves) + (0 if own is None else own.shape[-1])
        further = np.arange(self.shared_size, self.shared_size + extra)
        block = Block(
            residuals=(uv - views.uv).reshape(count, 2 * markers),
            by_shared=np.concatenate(by_shared, axis=-1).reshape(count, 2 * markers, -1),
            columns=np.concatenate([columns, further]),
            by_local=(by_point @ place.by_local).reshape(count, 2 * markers, -1),
        )
        hidden = self._hidden[stage]
        return block if hidden is None else _silenced(block, np.repeat(hidden, 2, axis=1))

    def _whitened(self, stage: str, block: Block) -> Block:
        if stage in self.whiteners:
            whitener = self.whiteners[stage]
            residuals = (whitener @ block.residuals[..., None])[..., 0]
            return Block(
                residuals, whitener @ block.by_shared, block.columns, whitener @ block.by_local
            )
        weights = self._weights[stage]
        return Block(
            block.residuals * weights,
            block.by_shared * weights[..., None],
            block.columns,
            block.by_local * weights[..., None],
        )


@lru_cache
def _free_columns(
    parameters: tuple[str, ...], stage: str, lasers: int
) -> tuple[slice | list[int], np.ndarray]:
    """Which of a placement's parameters are free, and where among all shared parameters the free
    ones that act in a stage are: the camera's, then these."""
    camera = [i for i, name in enumerate(parameters) if name in CAMERA]
    names = placement_names(stage, lasers)
    free = [i for i, name in enumerate(names) if name in parameters]
    columns = [*camera, *(parameters.index(names[i]) for i in free)]
    everything = slice(None) if len(free) == len(names) else free
    return everything, np.array(columns, dtype=int)


def _silenced(block: Block, hidden: np.ndarray) -> Block:
    """A block in which the residuals of a mask ``(N, r)`` say nothing."""
    return Block(
        np.where(hidden, 0.0, block.residuals),
        np.where(hidden[..., None], 0.0, block.by_shared),
        block.columns,
        np.where(hidden[..., None], 0.0, block.by_local),
    )
