"""Which image points of one stage are wrong, camera and sheets being given.

Of a view with few markers each one is left out in turn: the one without which the rest agrees
with the noise is wrong, or one of several, if it cannot be told which. Of many markers those are
right on which a pose agrees that was found with a loss that forgives. A view of which nothing
agrees is wrong as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtri

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.calibration.robust import robust_poses
from sheetoflight.estimation.block_least_squares import SolverOptions, solve
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

FALSE_ALARM = 1e-3
"""Odds that anything at all is taken for wrong in a set of views that is right."""

_FEW_MARKERS = 4
"""Up to this number of points a view's markers are left out one by one."""

_PATIENCE = (64.0, 32.0, 16.0, 8.0, 4.0, 4.0)
"""Sizes of errors that are forgiven, in standard deviations, while a view's pose is found."""


@dataclass(frozen=True)
class Yardstick:
    """How large residuals may be.

    Parameters
    ----------
    scale : float
        How many times larger than the noise's their variance may be.
    told : float
        Degrees of freedom from which the noise's size is known.
    """

    scale: float
    told: float

    def limit(self, freedom: Array | float, odds: float) -> Array:
        """Sum of ``freedom`` squares, in units of the noise's variance, that chance exceeds with
        given odds."""
        freedom = np.maximum(freedom, 1.0)
        if np.isinf(self.told):
            return self.scale * np.asarray(chdtri(freedom, odds))
        quantile = fdtri(freedom, max(self.told, 1.0), 1.0 - odds)
        return self.scale * np.asarray(freedom * quantile)


@dataclass(frozen=True)
class Decision:
    """What of a stage is left out.

    Parameters
    ----------
    wrong : (N, M) mask
        Points.
    doubtful : (N,) mask
        Views in which one of several markers is wrong, it cannot be told which.
    """

    wrong: np.ndarray
    doubtful: np.ndarray


@dataclass(frozen=True)
class GivenStage:
    """The views of one stage, camera and sheets being given.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    stage : str
    views : TargetViews
    state : RigState
    """

    rig: Rig
    noise: NoiseModel
    stage: str
    views: TargetViews
    state: RigState

    def of(self, views: TargetViews) -> GivenStage:
        """The same with other image points."""
        return replace(self, views=views)

    def robustly_posed(self) -> GivenStage:
        """With poses on which most markers of each view agree."""
        state = robust_poses(self.rig, self.state, self.stage, self.views)
        return replace(self, state=state)

    def posed(self, adjustment: Adjustment | None = None) -> GivenStage:
        """With the poses adjusted, by default with the noise's own weights."""
        solution = solve(adjustment or self.adjustment(), self.state, _POSE_STEPS)
        return replace(self, state=solution.state)

    def adjustment(self) -> Adjustment:
        """Of the poses alone."""
        rod = replace(self.rig, board=None)  # boards are judged by themselves
        return self.noise.adjustment(rod, {self.stage: self.views}, (), self.state)

    def errors(self) -> Array:
        """Observed minus predicted image points ``(N, M, 2)``, px; NaN where not seen."""
        return self.adjustment().residuals_px(self.state)[self.stage]

    def squares(self) -> Array:
        """Squared reprojection errors ``(N, M)`` in units of each marker's own variance; 0 where
        it was not seen."""
        adjustment, seen = self.adjustment(), self.views.seen[..., None]
        count, points = self.views.uv.shape[:2]
        covariance = self.noise.covariance(adjustment, self.state, self.stage)
        whole = covariance.reshape(count, points, 2, points, 2)
        own = np.moveaxis(whole.diagonal(axis1=1, axis2=3), -1, 1)
        own = np.where(seen[..., None], own, np.eye(2))
        errors = np.where(seen, np.nan_to_num(self.errors(), nan=1e6), 0.0)
        return np.sum(errors * np.linalg.solve(own, errors[..., None])[..., 0], axis=-1)

    def chi2(self) -> tuple[Array, Array]:
        """Degrees of freedom and chi-squared ``(N,)`` of each view's best pose."""
        try:
            best = self.robustly_posed().posed()
        except np.linalg.LinAlgError:
            return np.zeros(len(self.views)), np.full(len(self.views), np.inf)
        (block,) = best.adjustment().blocks(best.state)
        freedom = 2 * self.views.seen.sum(axis=1) - LOCAL_SIZE[self.stage]
        squares = np.nan_to_num(np.sum(block.residuals**2, axis=1), nan=np.inf)
        return np.maximum(freedom, 0).astype(float), squares


_POSE_STEPS = SolverOptions(iterations=12, damping=1e-3)


def decided(given: GivenStage, yardstick: Yardstick) -> Decision:
    """Which points of a stage are wrong."""
    few = given.views.uv.shape[1] <= _FEW_MARKERS
    return (_decided_by_trial if few else _decided_by_agreement)(given, yardstick)


def _decided_by_trial(given: GivenStage, yardstick: Yardstick) -> Decision:
    """Leave out each marker of the views that do not agree with the noise."""
    views = given.views
    count, points = views.uv.shape[:2]
    freedom, chi2 = given.chi2()
    undecided = (freedom > 0) & (chi2 > yardstick.limit(freedom, FALSE_ALARM / count))
    wrong, explanations = np.zeros((count, points), dtype=bool), np.zeros(count, dtype=int)
    for left_out in range(points if undecided.any() else 0):
        mask = np.zeros((count, points), dtype=bool)
        mask[:, left_out] = views.seen[:, left_out] & undecided
        less, rest = given.of(views.without(mask)).chi2()
        agrees = (less > 0) & (rest <= yardstick.limit(less, FALSE_ALARM / count))
        explains = mask[:, left_out] & agrees
        wrong |= mask & explains[:, None]
        explanations += explains
    wrong[undecided & (explanations == 0)] = True
    return Decision(wrong & views.seen, explanations > 1)


def _decided_by_agreement(given: GivenStage, yardstick: Yardstick) -> Decision:
    """Find each view's pose with a loss that forgives, then keep the markers that agree."""
    views = given.views
    count, points = views.uv.shape[:2]
    limit = float(yardstick.limit(2.0, FALSE_ALARM / (count * points)))
    there = given.robustly_posed()
    for patience in _PATIENCE:
        there = there.posed(_forgiving(there, patience * np.sqrt(yardstick.scale)))
    wrong = np.zeros((count, points), dtype=bool)
    for _ in range(3):
        wrong = (there.of(views).squares() > limit) & views.seen
        left = (views.seen & ~wrong).sum(axis=1)
        wrong[left < 2] = views.seen[left < 2]
        there = there.of(views.without(wrong & (left >= 2)[:, None])).posed()
    return Decision(wrong, np.zeros(count, dtype=bool))


def _forgiving(given: GivenStage, patience: float) -> Adjustment:
    """The adjustment in which errors beyond ``patience`` standard deviations count ever less
    (Geman and McClure)."""
    weight = np.clip((patience**2 / (patience**2 + given.squares())) ** 2, 1e-8, 1.0)
    std = {given.stage: given.noise.std(given.stage) / np.sqrt(weight)}
    return Adjustment(given.rig.target.positions, {given.stage: given.views}, std, ())
