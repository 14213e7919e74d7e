"""What the views of a finished calibration told, so that further ones can be planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sheetoflight.calibration.plan import Told
from sheetoflight.calibration.planned_rig import PlannedRig
from sheetoflight.calibration.predicted_views import view_shares
from sheetoflight.calibration.rig_state import ANCHOR, RigState
from sheetoflight.calibration.uncertainty import STAGE_SOURCES
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.calibration import Calibration, ViewResiduals
from sheetoflight.model.observations import TargetViews


def taken_views(planned: PlannedRig, calibration: Calibration) -> Told | None:
    """What the views of a calibration tell, as one set; None where it carries none.

    Parameters
    ----------
    planned : PlannedRig
        The nominal rig is the calibration's own.
    calibration : Calibration
    """
    whole: Told | None = None
    for stage in STAGE_SOURCES:
        views = [view for view in calibration.residuals.views if view.stage == stage]
        views = [view for view in views if np.isfinite(view.xyz).all(axis=1).sum() >= 2]
        if not views or (stage == "camera" and not set(ANCHOR) <= set(planned.parameters)):
            continue
        own = _told_by_taken(planned, stage, views)
        whole = own if whole is None else whole + own
    return whole


def _told_by_taken(planned: PlannedRig, stage: str, views: Sequence[ViewResiduals]) -> Told:
    starts, along = zip(*(_start_and_direction(planned, view.xyz) for view in views), strict=True)
    start, direction = np.array(starts), np.array(along)
    lasers = np.zeros(len(views), dtype=int)
    poses = direction
    if stage == "plane":
        lasers = _nearest_sheets(planned.state, start, direction)
        frames = planned.state.frames[lasers]
        flat = np.einsum("ni,nik->nk", start, frames[:, :, :2])
        turned = np.einsum("ni,nik->nk", direction, frames[:, :, :2])
        poses = np.column_stack([flat, np.arctan2(turned[:, 1], turned[:, 0])])
    if stage == "crossing":
        middle = start + planned.rig.target.positions.mean() * direction
        poses = np.concatenate([middle, direction], axis=1)
    names = tuple(str(index) for index in range(len(views)))
    seen = TargetViews(names, np.stack([view.uv for view in views]), laser=lasers)
    known = (planned.rig, planned.state, planned.noise, planned.parameters)
    information, placement, by_marker = view_shares(*known, stage, seen, poses)
    return Told(
        {stage: information.sum(axis=0, keepdims=True)},
        {stage: placement.sum(axis=0, keepdims=True)},
        by_marker.sum(axis=0, keepdims=True),
    )


def _start_and_direction(planned: PlannedRig, xyz: Array) -> tuple[Array, Array]:
    """Marker 0 and the direction of a target, from the markers that are known."""
    positions = planned.rig.target.positions
    known = np.flatnonzero(np.isfinite(xyz[: len(positions)]).all(axis=1))
    first, last = known[0], known[-1]
    direction = normalised(xyz[last] - xyz[first])
    return xyz[first] - positions[first] * direction, direction


def _nearest_sheets(state: RigState, start: Array, direction: Array) -> np.ndarray:
    """The sheet in which each target lies."""
    normals = state.frames[:, :, 2]
    off = np.abs(start @ normals.T - state.distances)
    off += np.abs(direction @ normals.T) * np.linalg.norm(start, axis=1, keepdims=True)
    return np.argmin(off, axis=1)


def pivot_of(calibration: Calibration) -> Array | None:
    """The fixed point of a calibration's pivoting target; None where it is not known."""
    points = [view.xyz[0] for view in calibration.residuals.views if view.stage == "camera"]
    known = [point for point in points if np.isfinite(point).all()]
    return np.median(known, axis=0) if known else None
