"""A fit that wrong detections do not spoil.

It begins with every camera of square pixels and with medians and consensus in place of means, and
then weighs each marker by its reprojection error e: ``w = (c²/(c² + e²))²`` (S. Geman and
D. McClure, Bull. Int. Stat. Inst. 52(4), 1987), with c falling from the size of gross errors to
that of the noise, so that the many right markers decide before the few wrong ones can (graduated
non-convexity; A. Blake and A. Zisserman, *Visual Reconstruction*, 1987).
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, combinations, islice

import numpy as np

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.crossing_start import crossings_in_front, with_crossings
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.pose_reselection import reselected_directions
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.sheet_map_closed_form import sheet_map
from sheetoflight.calibration.starts import (
    Evidence,
    cameras,
    evidence,
    pivoting_state,
    plain_cameras,
    seen_plane,
    with_sheets,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import SolverOptions, solve
from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_GROSS = 0.02
"""Size of gross errors, as a part of the picture's diagonal: where c begins."""

_FALL = 0.5
_NOISE_SCALES = 4.0
_STEPS = 6
_TRIPLES = 300
_STARTS = 4
"""How many of the starts, those with the least median error, are followed."""

_RIGHT = 0.5
"""Weight above which a marker counts as right."""


@dataclass(frozen=True)
class RobustFit:
    """Estimates that wrong markers did not spoil.

    Parameters
    ----------
    state : RigState
    right : mapping from stage to (N, M) mask
        Markers that agree with it.
    scale_px : float
        Median reprojection error.
    stage_scales_px : mapping from stage to float
        The same by stage.
    """

    state: RigState
    right: Mapping[str, np.ndarray]
    scale_px: float
    stage_scales_px: Mapping[str, float]


def robust_fit(task: EstimationTask) -> RobustFit:
    """Camera, sheets and poses from views of which some are wrong.

    Raises
    ------
    UntrustworthyError
        If no start leads anywhere.
    """
    rig, found = task.rig, _robust_evidence(task.rig)
    starts, refusal = [], None
    every = chain(cameras(rig, found), plain_cameras(rig))
    for camera in every if task.start is None else (task.start.camera,):
        try:
            state = pivoting_state(rig, found, camera)
            if task.start is not None:
                state = state.with_poses("board", task.start.poses["board"])
            state = _robust_state(rig, found, state, task.stages)
        except UntrustworthyError as reason:
            refusal = refusal or reason
            continue
        starts.append((_median_error(state, rig, task.stages), len(starts), state))
    fits = []
    for _, _, state in sorted(starts)[:_STARTS]:
        with suppress(np.linalg.LinAlgError):
            fits.append(_reweighted(task, state))
    if not fits:
        raise refusal or UntrustworthyError("joint", "nothing fits the views", "detect them again")
    return min(fits, key=lambda fit: fit.scale_px)


def _reweighted(task: EstimationTask, state: RigState) -> RobustFit:
    """Adjust and weigh in turn, with ever less patience for large errors."""
    rig, stages = task.rig, task.stages
    scale = _GROSS * float(np.hypot(*rig.image_size))
    state = _weighted_step(task, task.others, state, scale)
    rounds, settled_rounds = 0, 0
    while settled_rounds < 3 and rounds < 40:
        rounds += 1
        free = task.free if settled_rounds else task.without_distortion
        state = _weighted_step(task, free, state, scale)
        median = _median_error(state, rig, stages)
        floor = _NOISE_SCALES * median
        settled_rounds += scale <= floor
        scale = max(_FALL * scale, floor)
    errors = _errors(state, rig, stages)
    right = {stage: _weight(e, scale) > _RIGHT for stage, e in errors.items()}
    scales = {s: _median_error(state, rig, {s: views}) for s, views in stages.items()}
    return RobustFit(state, right, _median_error(state, rig, stages), scales)


def _weighted_step(
    task: EstimationTask, free: tuple[str, ...], state: RigState, scale: float
) -> RigState:
    rig, stages = task.rig, task.stages
    errors = _errors(state, rig, stages)
    std = {
        stage: task.noise.std(stage) / np.sqrt(np.maximum(_weight(errors[stage], scale), 1e-8))
        for stage in stages
    }
    adjustment = Adjustment(rig.target.positions, stages, std, free)
    state = solve(adjustment, state, SolverOptions(iterations=_STEPS, damping=1e-4)).state
    views = stages.get("camera")
    if views is not None:
        directions, _ = reselected_directions(
            state.camera, state.anchor, state.poses["camera"], views, rig.target.positions, scale
        )
        state = state.with_poses("camera", directions)
    return state


def _weight(errors: Array, scale: float) -> Array:
    return (scale**2 / (scale**2 + np.nan_to_num(errors, nan=0.0) ** 2)) ** 2


def _errors(state: RigState, rig: Rig, stages: Mapping[str, TargetViews]) -> dict[str, Array]:
    """Reprojection error ``(N, M)`` of every marker, px; NaN where not seen."""
    std = {stage: np.ones(views.uv.shape[:2]) for stage, views in stages.items()}
    residuals = Adjustment(rig.target.positions, stages, std, ()).residuals_px(state)
    errors = {}
    for stage, views in stages.items():
        size = np.linalg.norm(residuals[stage], axis=-1)
        # what cannot be projected at all is as wrong as can be
        errors[stage] = np.where(views.seen & ~np.isfinite(size), 1e6, size)
    return errors


def _median_error(state: RigState, rig: Rig, stages: Mapping[str, TargetViews]) -> float:
    errors = _errors(state, rig, stages)
    return max(float(np.nanmedian(np.concatenate([e.ravel() for e in errors.values()]))), 1e-9)


def _robust_evidence(rig: Rig) -> Evidence:
    """Evidence whose homographies are those that most targets in a sheet agree with."""
    found = evidence(rig)
    length = rig.target.positions[-1]
    views = rig.observations.plane
    sheets = []
    for laser in range(len(rig.lasers)):
        uv = views.uv[views.lasers == laser]
        points = uv * found.pixels[0, 0] + found.pixels[:2, 2]
        sheets.append(_agreed_sheet(points, rig.target.positions / length))
    return Evidence(found.pixels, found.length, found.pivot, tuple(sheets))


def _agreed_sheet(points: Array, positions: Array) -> Array | None:
    """Homography from a sheet to the image that gives most distances between markers right."""
    whole = np.flatnonzero(np.isfinite(points).all(axis=(1, 2)))
    if len(whole) < 3:
        return None
    pairs = np.array(list(combinations(range(len(positions)), 2)))
    true = positions[pairs[:, 1]] - positions[pairs[:, 0]]
    best, least = None, np.inf
    order = np.random.default_rng(0).permutation(whole)  # any order will do, but always the same
    for triple in islice(combinations(order, 3), _TRIPLES):
        mapped = sheet_map(points[list(triple)], positions)
        if mapped is None:
            continue
        homogeneous = points[whole] @ mapped[:, :2].T + mapped[:, 2]
        flat = homogeneous[..., :2] / homogeneous[..., 2:]
        gaps = np.linalg.norm(flat[:, pairs[:, 1]] - flat[:, pairs[:, 0]], axis=-1)
        median = float(np.median(np.abs(np.log(np.maximum(gaps, 1e-12) / true))))
        if median < least:
            best, least = mapped, median
    return None if best is None else np.linalg.inv(best)


def _robust_state(
    rig: Rig, found: Evidence, state: RigState, stages: Mapping[str, TargetViews]
) -> RigState:
    """A starting state in which single wrong markers decide over no pose."""
    if "camera" in stages:
        state = robust_poses(rig, state, "camera", stages["camera"])
    if "plane" not in stages or any(sheet is None for sheet in found.sheets):
        return with_sheets(rig, found, state)
    planes = [seen_plane(found, sheet, state.camera) for sheet in found.sheets if sheet is not None]
    state = replace(
        state,
        frames=np.array([np.stack([*tangent_basis(n), n], axis=1) for n, _ in planes]),
        distances=np.array([d for _, d in planes]),
    )
    state = robust_poses(rig, state, "plane", stages["plane"])
    return crossings_in_front(rig, with_crossings(rig, state))


def robust_poses(rig: Rig, state: RigState, stage: str, views: TargetViews) -> RigState:
    """The state with poses of one stage's views on which most of their markers agree.

    Raises
    ------
    UntrustworthyError
        If a view cannot lie in its sheet at all.
    """
    if stage == "camera":
        gross = _GROSS * float(np.hypot(*rig.image_size))
        camera, anchor = state.camera, state.anchor
        now = state.poses["camera"]
        found, _ = reselected_directions(camera, anchor, now, views, rig.target.positions, gross)
        return state.with_poses("camera", found)
    if stage == "plane":
        return state.with_poses("plane", _agreed_poses(rig, state, views))
    return state


def _agreed_poses(rig: Rig, state: RigState, views: TargetViews) -> Array:
    """x, y, ψ of targets in the sheet, from the pair of markers that the others agree with."""
    rays = state.camera.unproject(views.uv)
    frames = state.frames[views.lasers]
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = state.distances[views.lasers][:, None] / np.einsum(
            "nmi,ni->nm", rays, frames[:, :, 2]
        )
    depths = np.where(depths > 0, depths, np.nan)
    flat = np.einsum("nmi,nik->nmk", rays * depths[..., None], frames[:, :, :2])
    positions = rig.target.positions
    best, least = np.zeros((len(views), 3)), np.full(len(views), np.inf)
    for first, last in combinations(range(len(positions)), 2):
        along = flat[:, last] - flat[:, first]
        angle = np.arctan2(along[:, 1], along[:, 0])
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        middle = 0.5 * (flat[:, first] + flat[:, last])
        start = middle - 0.5 * (positions[first] + positions[last]) * direction
        expected = start[:, None] + positions[:, None] * direction[:, None]
        errors = np.linalg.norm(flat - expected, axis=-1)
        cost = np.nanmedian(np.where(np.isfinite(errors), errors, np.inf), axis=1)
        better = cost < least
        best[better] = np.column_stack([start, angle])[better]
        least = np.where(better, cost, least)
    lost = ~np.isfinite(least)
    if lost.all():
        raise UntrustworthyError(
            "plane",
            "no target can lie in the sheet of light that the views give together",
            "check the views of stage plane; move the laser aside if its sheet passes through or "
            "near the camera",
        )
    # a view that fits nowhere goes where others are, to be told wrong by its residuals
    best[lost] = np.median(best[~lost], axis=0)
    return best
