"""Wrong detections and wrong views: found by a robust fit, then decided one by one.

A loss that forgives large errors finds the rig in spite of them, but leaves it open what was
wrong and blurs the uncertainty. So it only prepares the decision: given camera and sheets, every
view is fitted with all its markers, with each one left out, and – of many markers – with each
two left out. It keeps as many markers as agree with the noise; a view that agrees with none of
these is wrong as a whole. What is left is adjusted anew, and the decision repeated until it
stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtri

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.fitting import Fit, fitted
from sheetoflight.calibration.noise import PIXEL, NoiseModel
from sheetoflight.calibration.residual_tests import (
    exact,
    quiet_variance,
    residual_tests,
)
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState, intrinsic_names
from sheetoflight.calibration.robust import robust_fit, robust_poses
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import SolverOptions, solve
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig

_FALSE_ALARM = 1e-3
"""Odds that anything at all is taken for wrong in a set of views that is right."""

_ROUNDS = 8
_FEW_MARKERS = 4
"""Up to this number of points a view's markers are left out one by one; of more, a loss that
forgives tells which agree."""

_FIRST_CAUTION = 4.0
"""How many times the noise's variance is taken in the first round, when the robust estimates are
still rough."""

_MOST = 0.45
"""Share of a stage's points that may be wrong: beyond, the majority is not to be trusted."""

_PER_NORMAL = 1.1774
"""Median length of a plane normal vector, in standard deviations."""

_HEAVY_TAILS = 1.4
"""Ratio of the residuals' root mean square to their scaled median above which they are not
normal: of 100 normal residuals it scatters by 8 % about 1."""

_PATIENCE = (64.0, 32.0, 16.0, 8.0, 4.0, 4.0)
"""Sizes of errors that are forgiven, in standard deviations, while a view's pose is found."""


@dataclass(frozen=True)
class Wrong:
    """What of a view does not belong to the rest.

    Parameters
    ----------
    stage, view : str
    markers : tuple of int
        Those left out; empty where the whole view is.
    one_of : bool
        Whether one of these markers is wrong, and the view cannot tell which.
    error_px : float
        How far the markers are from where the view's others put them, at most; of a whole view,
        the root mean square error per coordinate of its best fit.
    """

    stage: str
    view: str
    markers: tuple[int, ...]
    one_of: bool
    error_px: float

    @property
    def in_words(self) -> str:
        """What was left out, and why."""
        where = f"view {self.view} of stage {self.stage}"
        if not self.markers:
            return f"{where} (residuals {self.error_px:.2g} px at best)"
        names = (" or " if self.one_of else ", ").join(str(m) for m in self.markers)
        several = len(self.markers) > 1 and not self.one_of
        return f"marker{'s' if several else ''} {names} of {where} ({self.error_px:.2g} px off)"


@dataclass(frozen=True)
class Cleaned:
    """A rig without what is wrong, and what that was.

    Parameters
    ----------
    rig : Rig
    wrong : tuple of Wrong
    masks : mapping from stage to (N, M) mask
        The same, as points of the original views.
    """

    rig: Rig
    wrong: tuple[Wrong, ...]
    masks: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class _Yardstick:
    """How many times larger than the noise's the residuals' variance may be, and the degrees of
    freedom from which the noise's size is known."""

    scale: float
    told: float

    def limit(self, freedom: Array, odds: float) -> Array:
        """Greatest sum of squares, in units of the noise's variance."""
        return self.scale * _limit(freedom, odds, self.told)


@dataclass(frozen=True)
class _Decision:
    """Points of a stage that are left out ``(N, M)``, and views ``(N,)`` in which that is one of
    several markers, it cannot be told which."""

    wrong: np.ndarray
    doubtful: np.ndarray


def looks_wrong(fit: Fit) -> bool:
    """Whether some residual of a fit is too large for noise, or all are distributed as noise is
    not."""
    if exact(fit):
        return False
    try:
        tests = residual_tests(fit)
    except np.linalg.LinAlgError:
        return True
    scale = max(quiet_variance(tests), 1e-300)
    every = np.concatenate([test.marker[test.marker > 0] for test in tests.values()])
    if not every.size:
        return False
    median = float(np.median(every)) / float(chdtri(2, 0.5))
    if every.mean() / 2.0 > _HEAVY_TAILS**2 * median:
        return True
    views = sum(len(test.view) for test in tests.values())
    told = _told_freedom(fit)
    marker_limit = scale * float(_limit(np.array(2.0), _FALSE_ALARM / every.size, told))
    view_limits = [
        scale * _limit(test.freedom, _FALSE_ALARM / max(views, 1), told) for test in tests.values()
    ]
    return bool(every.max() > marker_limit) or any(
        (test.view > limit).any() for test, limit in zip(tests.values(), view_limits, strict=True)
    )


def _told_freedom(fit: Fit) -> float:
    """Degrees of freedom from which the size of the noise is known."""
    estimated = fit.noise.free[PIXEL] and fit.degrees_of_freedom > 0
    return float(fit.degrees_of_freedom) if estimated else np.inf


def _limit(freedom: Array, odds: float, told: float) -> Array:
    """Sum of ``freedom`` squares, in units of a variance known from ``told`` degrees of freedom,
    that chance exceeds with given odds."""
    freedom = np.maximum(freedom, 1.0)
    if np.isinf(told):
        return np.asarray(chdtri(freedom, odds))
    return np.asarray(freedom * fdtri(freedom, max(told, 1.0), 1.0 - odds))


def cleaned(rig: Rig, noise: NoiseModel, others: tuple[str, ...]) -> Cleaned:
    """The rig without wrong markers and views.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    others : tuple of str
        Shared parameters beside the camera's.

    Raises
    ------
    UntrustworthyError
        If so much would be wrong that what is right cannot be told.
    """
    stages = rig.observations.stages()
    robust = robust_fit(rig, noise, stages, others)
    state, masks = robust.state, {s: ~right for s, right in robust.right.items()}
    variances = noise.variances.copy()
    if noise.free[PIXEL]:
        variances[PIXEL] = (robust.scale_px / _PER_NORMAL) ** 2
    noise_now = noise.with_variances(variances)
    scales = {
        s: _FIRST_CAUTION * max(1.0, (px / _PER_NORMAL) ** 2 / variances[PIXEL])
        for s, px in robust.stage_scales_px.items()
    }
    free = (*intrinsic_names(rig.free_intrinsics), *others)
    decided: dict[str, _Decision] = {}
    told = np.inf
    for _ in range(_ROUNDS):
        decided = {
            s: _decided(rig, noise_now, s, views, state, _Yardstick(scales[s], told))
            for s, views in stages.items()
        }
        same = all((decided[s].wrong == masks[s]).all() for s in stages)
        masks = {s: decision.wrong for s, decision in decided.items()}
        _refuse_too_many(decided, stages)
        kept = {s: v.without(masks[s]) for s, v in stages.items()}
        whole = {s: v.seen.sum(axis=1) >= 2 for s, v in kept.items()}
        trimmed = {s: v.take(whole[s]) for s, v in kept.items() if whole[s].any()}
        within = _taken(state, whole)
        noise_here = _narrowed(noise, whole).with_variances(noise_now.variances)
        fit = fitted(rig, trimmed, free, within, noise_here, "joint")
        noise_now = noise_now.with_variances(fit.noise.variances)
        scales, told = _stage_scales(fit, stages), _told_freedom(fit)
        state = _returned(state, fit.state, whole)
        if same:
            break
    return Cleaned(_without(rig, masks), _named(rig, noise_now, state, decided), masks)


def _stage_scales(fit: Fit, stages: Mapping[str, TargetViews]) -> dict[str, float]:
    """By how much each stage's residuals exceed the noise that all stages share."""
    scales = dict.fromkeys(stages, 1.0)
    try:
        tests = residual_tests(fit)
    except np.linalg.LinAlgError:
        return scales
    for stage, test in tests.items():
        scales[stage] = max(1.0, float(test.view.sum() / max(test.freedom.sum(), 1.0)))
    return scales


def _decided(
    rig: Rig,
    noise: NoiseModel,
    stage: str,
    views: TargetViews,
    state: RigState,
    yardstick: _Yardstick,
) -> _Decision:
    """Which points of a stage are wrong, camera and sheets being given."""
    few = views.uv.shape[1] <= _FEW_MARKERS
    decide = _decided_by_trial if few else _decided_by_agreement
    return decide(rig, noise, stage, views, state, yardstick)


def _decided_by_trial(
    rig: Rig,
    noise: NoiseModel,
    stage: str,
    views: TargetViews,
    state: RigState,
    yardstick: _Yardstick,
) -> _Decision:
    """Leave out each marker of the views that do not agree with the noise."""
    count, points = views.uv.shape[:2]
    freedom, chi2 = _chi2(rig, noise, stage, views, state)
    limit = yardstick.limit(freedom, _FALSE_ALARM / count)
    wrong, explanations = np.zeros((count, points), dtype=bool), np.zeros(count, dtype=int)
    undecided = (freedom > 0) & (chi2 > limit)
    for left_out in range(points if undecided.any() else 0):
        mask = np.zeros((count, points), dtype=bool)
        mask[:, left_out] = views.seen[:, left_out] & undecided
        less, rest = _chi2(rig, noise, stage, views.without(mask), state)
        limit = yardstick.limit(less, _FALSE_ALARM / count)
        explains = mask[:, left_out] & (less > 0) & (rest <= limit)
        wrong |= mask & explains[:, None]
        explanations += explains
    wrong[undecided & (explanations == 0)] = True
    return _Decision(wrong & views.seen, explanations > 1)


def _decided_by_agreement(
    rig: Rig,
    noise: NoiseModel,
    stage: str,
    views: TargetViews,
    state: RigState,
    yardstick: _Yardstick,
) -> _Decision:
    """Find each view's pose with a loss that forgives, then keep the markers that agree."""
    count, points = views.uv.shape[:2]
    limit = float(yardstick.limit(np.array(2.0), _FALSE_ALARM / (count * points)))
    there = robust_poses(rig, state, stage, views)
    for patience in _PATIENCE:
        squares = _squares(rig, noise, stage, views, there) / yardstick.scale
        weight = np.clip((patience**2 / (patience**2 + squares)) ** 2, 1e-8, 1.0)
        std = {stage: noise.std(stage) / np.sqrt(weight)}
        there = _posed(Adjustment(rig.target.positions, {stage: views}, std, ()), there)
    wrong = np.zeros((count, points), dtype=bool)
    for _ in range(3):
        wrong = (_squares(rig, noise, stage, views, there) > limit) & views.seen
        left = (views.seen & ~wrong).sum(axis=1)
        wrong[left < 2] = views.seen[left < 2]
        right = views.without(wrong & (left >= 2)[:, None])
        there = _posed(noise.adjustment(rig, {stage: right}, (), there), there)
    return _Decision(wrong, np.zeros(count, dtype=bool))


def _squares(rig: Rig, noise: NoiseModel, stage: str, views: TargetViews, state: RigState) -> Array:
    """Squared reprojection errors ``(N, M)`` in units of each marker's own variance; 0 where it
    was not seen."""
    adjustment = noise.adjustment(rig, {stage: views}, (), state)
    residuals = adjustment.residuals_px(state)[stage]
    count, points = residuals.shape[:2]
    whole = noise.covariance(adjustment, state, stage).reshape(count, points, 2, points, 2)
    own = np.moveaxis(whole.diagonal(axis1=1, axis2=3), -1, 1)
    own = np.where(views.seen[..., None, None], own, np.eye(2))
    errors = np.where(views.seen[..., None], np.nan_to_num(residuals, nan=1e6), 0.0)
    return np.sum(errors * np.linalg.solve(own, errors[..., None])[..., 0], axis=-1)


def _posed(adjustment: Adjustment, state: RigState) -> RigState:
    """The poses alone, adjusted."""
    return solve(adjustment, state, SolverOptions(iterations=12, damping=1e-3)).state


def _chi2(
    rig: Rig, noise: NoiseModel, stage: str, views: TargetViews, state: RigState
) -> tuple[Array, Array]:
    """Degrees of freedom and chi-squared ``(N,)`` of each view's best pose."""
    there = robust_poses(rig, state, stage, views)
    adjustment = noise.adjustment(rig, {stage: views}, (), there)
    try:
        fit = solve(adjustment, there, SolverOptions(iterations=12, damping=1e-3))
    except np.linalg.LinAlgError:
        return np.zeros(len(views)), np.full(len(views), np.inf)
    (block,) = adjustment.blocks(fit.state)
    chi2 = np.sum(block.residuals**2, axis=1)
    freedom = 2 * views.seen.sum(axis=1) - LOCAL_SIZE[stage]
    return np.maximum(freedom, 0).astype(float), np.nan_to_num(chi2, nan=np.inf)


def _refuse_too_many(decided: Mapping[str, _Decision], stages: Mapping[str, TargetViews]) -> None:
    for stage, decision in decided.items():
        # where one of several markers is wrong, it is one
        count = decision.wrong[~decision.doubtful].sum() + decision.doubtful.sum()
        share = count / max(stages[stage].seen.sum(), 1)
        if share > _MOST:
            raise UntrustworthyError(
                stage,
                f"{share:.0%} of the markers disagree with the others (limit {_MOST:.0%}), so "
                "that it cannot be told which are right",
                "check markers_mm and the lens model in rig.toml, whether the fixed point or the "
                "laser moved, and the order of the markers",
            )


def _taken(state: RigState, whole: Mapping[str, np.ndarray]) -> RigState:
    return replace(state, poses={s: p[whole[s]] for s, p in state.poses.items() if s in whole})


def _returned(old: RigState, new: RigState, whole: Mapping[str, np.ndarray]) -> RigState:
    """The new state, with the poses of views that took no part as they were."""
    poses = dict(old.poses)
    for stage, fitted_poses in new.poses.items():
        poses[stage] = old.poses[stage].copy()
        poses[stage][whole[stage]] = fitted_poses
    return replace(new, poses=poses)


def _narrowed(noise: NoiseModel, whole: Mapping[str, np.ndarray]) -> NoiseModel:
    return replace(noise, proportions={s: noise.proportions[s][w] for s, w in whole.items()})


def _without(rig: Rig, masks: Mapping[str, np.ndarray]) -> Rig:
    """The rig without the points of the masks, and without views that are left with fewer than
    two of the target's markers."""
    markers = len(rig.target.markers_mm)
    kept = {}
    for stage, views in rig.observations.stages().items():
        left = views.without(masks[stage])
        kept[stage] = left.take(left.seen[:, :markers].sum(axis=1) >= 2)
    return replace(rig, observations=Observations(**kept))


def _named(
    rig: Rig, noise: NoiseModel, state: RigState, decided: Mapping[str, _Decision]
) -> tuple[Wrong, ...]:
    """What is wrong, view by view."""
    found: list[Wrong] = []
    for stage, views in rig.observations.stages().items():
        decision = decided[stage]
        left = views.without(decision.wrong)
        enough = left.seen.sum(axis=1) >= 2
        # of a view that is left with too little, the best fit of everything is told
        shown = TargetViews(
            views.names,
            np.where(enough[:, None, None], left.uv, views.uv),
            views.std,
            views.laser,
        )
        there = robust_poses(rig, state, stage, shown)
        adjustment = noise.adjustment(rig, {stage: shown}, (), there)
        there = _posed(adjustment, there)
        errors = views.uv - there.camera.project(adjustment.placed(there, stage).points)
        sizes = np.linalg.norm(errors, axis=-1)
        for index in np.flatnonzero(decision.wrong.any(axis=1)):
            mask, doubtful = decision.wrong[index], bool(decision.doubtful[index])
            if enough[index] or doubtful:
                markers = tuple(int(marker) for marker in np.flatnonzero(mask))
                size = float(np.nanmax(sizes[index][mask]))
            else:
                markers, size = (), float(np.sqrt(np.nanmean(errors[index] ** 2)))
            found.append(Wrong(stage, views.names[index], markers, doubtful, size))
    return tuple(found)
