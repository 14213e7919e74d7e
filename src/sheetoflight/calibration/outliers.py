"""Wrong detections and wrong views: found by a robust fit, then decided one by one.

A loss that forgives large errors finds the rig in spite of them, but leaves it open what was
wrong and blurs the uncertainty. So it only prepares the decision, view by view, camera and sheets
being given (`wrong_points`). What is left is adjusted anew, and the decision repeated until it
stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.residual_tests import (
    quiet_variance,
    residual_tests,
)
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.robust import robust_fit
from sheetoflight.calibration.wrong_points import (
    FALSE_ALARM,
    Decision,
    GivenStage,
    Yardstick,
    decided,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_ROUNDS = 8
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


def looks_wrong(fit: Fit) -> bool:
    """Whether some residual of a fit is too large for noise, or all are distributed as noise is
    not."""
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
    yardstick = Yardstick(scale, _told_freedom(fit))
    if every.max() > float(yardstick.limit(2.0, FALSE_ALARM / every.size)):
        return True
    odds = FALSE_ALARM / max(views, 1)
    return any((test.view > yardstick.limit(test.freedom, odds)).any() for test in tests.values())


def _told_freedom(fit: Fit) -> float:
    """Degrees of freedom from which the size of the noise is known."""
    estimated = fit.noise.free[PIXEL] and fit.degrees_of_freedom > 0
    return float(fit.degrees_of_freedom) if estimated else np.inf


def cleaned(task: EstimationTask) -> Cleaned:
    """The rig without wrong markers and views.

    Raises
    ------
    UntrustworthyError
        If so much would be wrong that what is right cannot be told.
    """
    rig, noise, stages = task.rig, task.noise, task.stages
    robust = robust_fit(task)
    state, masks = robust.state, {s: ~right for s, right in robust.right.items()}
    variances = noise.variances.copy()
    if noise.free[PIXEL]:
        variances[PIXEL] = (robust.scale_px / _PER_NORMAL) ** 2
    noise_now = noise.with_variances(variances)
    scales = {
        s: _FIRST_CAUTION * max(1.0, (px / _PER_NORMAL) ** 2 / variances[PIXEL])
        for s, px in robust.stage_scales_px.items()
    }
    decisions: dict[str, Decision] = {}
    told = np.inf
    for _ in range(_ROUNDS):
        decisions = {
            s: decided(GivenStage(rig, noise_now, s, views, state), Yardstick(scales[s], told))
            for s, views in stages.items()
        }
        same = all((decisions[s].wrong == masks[s]).all() for s in stages)
        masks = {s: decision.wrong for s, decision in decisions.items()}
        _refuse_too_many(decisions, stages)
        kept = {s: v.without(masks[s]) for s, v in stages.items()}
        whole = {s: v.seen.sum(axis=1) >= 2 for s, v in kept.items()}
        trimmed = {s: v.take(whole[s]) for s, v in kept.items() if whole[s].any()}
        within = _taken(state, whole)
        noise_here = _narrowed(noise, whole).with_variances(noise_now.variances)
        fit = fitted(rig, trimmed, task.free, within, noise_here, task.blamed)
        noise_now = noise_now.with_variances(fit.noise.variances)
        scales, told = _stage_scales(fit, stages), _told_freedom(fit)
        state = _returned(state, fit.state, whole)
        if same:
            break
    return Cleaned(_without(rig, masks), _named(rig, noise_now, state, decisions), masks)


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


def _refuse_too_many(decisions: Mapping[str, Decision], stages: Mapping[str, TargetViews]) -> None:
    for stage, decision in decisions.items():
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
    """The state of the views that take part; of boards, all do."""
    poses = {s: p[whole[s]] if s in whole else p for s, p in state.poses.items()}
    return replace(state, poses=poses)


def _returned(old: RigState, new: RigState, whole: Mapping[str, np.ndarray]) -> RigState:
    """The new state, with the poses of views that took no part as they were."""
    poses = dict(old.poses)
    for stage, fitted_poses in new.poses.items():
        poses[stage] = fitted_poses
        if stage in whole:
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
    return replace(rig, observations=replace(rig.observations, **kept))


def _named(
    rig: Rig, noise: NoiseModel, state: RigState, decisions: Mapping[str, Decision]
) -> tuple[Wrong, ...]:
    """What is wrong, view by view."""
    found: list[Wrong] = []
    for stage, views in rig.observations.stages().items():
        decision = decisions[stage]
        left = views.without(decision.wrong)
        enough = left.seen.sum(axis=1) >= 2
        # of a view that is left with too little, the best fit of everything is told
        shown = TargetViews(
            views.names,
            np.where(enough[:, None, None], left.uv, views.uv),
            views.std,
            views.laser,
        )
        best = GivenStage(rig, noise, stage, shown, state).robustly_posed().posed()
        errors = best.of(views).errors()
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
