"""What disturbs the image points: how it is correlated, and how large it is said to be.

``pixel`` noise moves every image coordinate by itself. A target laid into the sheet of light is
never exactly in it: ``placement`` moves its two ends off the sheet, independently, and the
markers between them with the straight rod; ``marker`` moves every marker by itself, as a bent
or carelessly glued target has them. With the image motion j of a marker per mm along the
sheet's normal, a view's covariance is ``Σ = σ² D + G (δ² B Bᵀ + ε² I) Gᵀ``, G holding the j.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.board_noise import board_variances
from sheetoflight.calibration.components import LINE, MARKER, PIXEL, PLACEMENT, SHAPE
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.estimation.variance_components import Contrasts, contrasts
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import proportions as proportions_of
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class NoiseModel:
    """Sizes and proportions of the noise.

    Parameters
    ----------
    proportions : mapping from stage to (N, M) array
        Of the image coordinates' standard uncertainties; root mean square 1.
    variances : (7,) array
        Of the `COMPONENTS`: px², mm², mm², px², px², mm², px².
    free : (7,) mask
        Which of them are to be estimated from the residuals.
    """

    proportions: Mapping[str, Array]
    variances: Array
    free: np.ndarray

    def with_variances(self, variances: Array) -> NoiseModel:
        """The same noise with other sizes."""
        return replace(self, variances=np.asarray(variances, dtype=float))

    def std(self, stage: str) -> Array:
        """Standard uncertainty of each image coordinate of a stage ``(N, M)``, px."""
        return np.sqrt(self.variances[PIXEL]) * self.proportions[stage]

    def adjustment(
        self,
        rig: Rig,
        stages: Mapping[str, TargetViews],
        free: tuple[str, ...],
        state: RigState | None = None,
    ) -> Adjustment:
        """The adjustment of some stages with this noise.

        Parameters
        ----------
        rig : Rig
        stages : mapping from stage to TargetViews
        free : tuple of str
            Shared parameters to estimate.
        state : RigState, optional
            Where the image motions j are evaluated; needed where there is placement noise.
        """
        std = {stage: self.std(stage) for stage in stages}
        boards = _board_evidence(rig, self.variances, state)
        plain = Adjustment(rig.target.positions, stages, std, free, None, boards)
        if "plane" not in stages or not self.placed_off or state is None:
            return plain
        covariance = self.covariance(plain, state, "plane")
        places = np.arange(covariance.shape[-1])
        unseen = ~np.repeat(stages["plane"].seen, 2, axis=1)
        covariance[:, places, places] += np.where(unseen, 1.0, 0.0)
        whitener = np.linalg.inv(np.linalg.cholesky(covariance))
        whiteners = {"plane": whitener}
        return Adjustment(rig.target.positions, stages, std, free, whiteners, boards)

    @property
    def placed_off(self) -> bool:
        """Whether targets are taken to lie off their sheets."""
        return bool(self.variances[[PLACEMENT, MARKER]].any())

    def parts(self, adjustment: Adjustment, state: RigState, stage: str) -> list[tuple[int, Array]]:
        """The components that act in a stage and their covariances per unit, ``(N, 2M, 2M)``."""
        views = adjustment.stages[stage]
        proportions = np.where(views.seen, self.proportions[stage], 0.0)
        places = np.arange(2 * proportions.shape[1])
        pixel = np.zeros((len(views), places.size, places.size))
        pixel[:, places, places] = np.repeat(proportions**2, 2, axis=1)
        parts: list[tuple[int, Array]] = [(PIXEL, pixel)]
        if stage == "plane":
            motion = off_sheet_motion(adjustment, state)
            for component, offsets in (
                (PLACEMENT, _rod_offsets(adjustment.positions)),
                (MARKER, np.eye(len(adjustment.positions))),
            ):
                if self.free[component] or self.variances[component] > 0:
                    parts.append((component, motion @ offsets @ np.swapaxes(motion, 1, 2)))
        return parts

    def covariance(self, adjustment: Adjustment, state: RigState, stage: str) -> Array:
        """Covariance of each view's image coordinates ``(N, 2M, 2M)``, px²."""
        parts = self.parts(adjustment, state, stage)
        return np.sum([self.variances[k] * part for k, part in parts], axis=0)

    def contrasts(
        self,
        adjustment: Adjustment,
        state: RigState,
        moves: Mapping[str, list[Array]],
        size_column: int | None = None,
    ) -> list[Contrasts]:
        """The adjustment at a state with each view's pose eliminated, stage by stage.

        Parameters
        ----------
        adjustment : Adjustment
        state : RigState
        moves : mapping from stage to list of (N, M, 3) arrays
            Further ways in which the points could move; columns behind the shared parameters.
        size_column : int, optional
            Where to put how the residuals move with the relative size of the boards.
        """
        groups = []
        for stage, views in adjustment.stages.items():
            block = adjustment.block(state, stage, moves.get(stage, ()))
            parts = self.parts(adjustment, state, stage)
            seen = np.repeat(views.seen, 2, axis=1)
            groups.append(contrasts(block, parts, seen))
        if adjustment.boards is not None:
            acting = [LINE] if self.free[LINE] or self.variances[LINE] > 0 else []
            acting += [SHAPE] if self.free[SHAPE] else []
            groups.append(
                adjustment.boards.contrasts(state, adjustment.parameters, acting, size_column)
            )
        return groups


def _board_evidence(rig: Rig, variances: Array, state: RigState | None) -> BoardEvidence | None:
    views = rig.observations.board
    if rig.board is None or not len(views):
        return None
    if state is None:
        return BoardEvidence(rig.board, views, variances)
    return BoardEvidence.at(rig.board, views, variances, state)


def off_sheet_motion(adjustment: Adjustment, state: RigState) -> Array:
    """G ``(N, 2M, M)``: how a marker's image moves per mm along the sheet's normal."""
    views = adjustment.stages["plane"]
    points = adjustment.placed(state, "plane").points
    _, by_point, _ = state.camera.project_with_jacobians(points, ())
    normals = state.frames[views.lasers][:, :, 2]
    along = np.einsum("nmij,nj->nmi", by_point, normals)
    along = np.where(views.seen[..., None], along, 0.0)
    count, markers = along.shape[:2]
    motion = np.zeros((count, markers, 2, markers))
    places = np.arange(markers)
    motion[:, places, :, places] = np.swapaxes(along, 0, 1)
    return motion.reshape(count, 2 * markers, markers)


def _rod_offsets(positions: Array) -> Array:
    """``B Bᵀ``: covariance of the markers' offsets for unit variance at both ends."""
    share = (positions - positions[0]) / (positions[-1] - positions[0])
    ends = np.stack([1.0 - share, share], axis=1)
    return ends @ ends.T


def noise_model(rig: Rig, start: RigState | None = None) -> NoiseModel:
    """The noise that a rig states, and what is left to be estimated.

    The points' own ``std`` give proportions only. A detector derives them from the grey values'
    noise; what else moves a marker – its print, its light, the lens – it cannot know, so the
    size comes from ``pixel_std``, as the root mean square over all points, or else from the
    residuals. Points without ``std`` count as typical ones.

    Parameters
    ----------
    rig : Rig
    start : RigState, optional
        Camera and poses of the boards, where there are boards: they tell how large the noise is,
        roughly.
    """
    stages, boards = rig.observations.stages(), rig.observations.board
    own = {
        stage: np.full(views.uv.shape[:2], np.nan) if views.std is None else views.std
        for stage, views in stages.items()
    }
    everywhere = np.concatenate([values.ravel() for values in own.values()] or [np.zeros(0)])
    known = everywhere[np.isfinite(everywhere)]
    typical = float(np.sqrt(np.mean(known**2))) if known.size else 1.0
    proportions = {
        stage: np.where(np.isfinite(values), values, typical) / typical
        for stage, values in own.items()
    }
    lying = "plane" in stages and rig.placement_std is None
    corner, stripe = (proportions_of(std)[1] for std in (boards.stds, boards.line.std))
    lines = len(boards.line) > 0
    std = [rig.pixel_std or typical, rig.placement_std or 0.0, 0.0]
    std += [rig.pixel_std or corner, stripe, 0.0, 0.0]
    open_size = rig.pixel_std is None
    free = [
        open_size and bool(stages),
        lying,
        lying,
        open_size and len(boards) > 0,
        lines,
        lines,
        lines,
    ]
    variances = np.array(std) ** 2
    if start is not None:
        told = board_variances(rig, start)
        variances = np.where(np.array(free) & np.isfinite(told), told, variances)
    return NoiseModel(proportions, variances, np.array(free))


def chi2_limit(degrees_of_freedom: int) -> float:
    """Chi-squared that noise alone exceeds once in a thousand times."""
    return float(chdtri(degrees_of_freedom, _FALSE_ALARM))
