"""How large the noise of boards is, roughly, before any of it is adjusted.

Points are known by what the fit of the points alone leaves, a line's points by their scatter about
their own straight line, and whole lines by their distance from the plane through all of them. An
adjustment that began with other proportions could bend the camera to please the lines.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.board_planes import ends_on_boards, planes_on_boards, point_errors
from sheetoflight.calibration.components import COMPONENTS, CORNER, LINE, SHAPE, STRIPE
from sheetoflight.calibration.lines_on_boards import RAY, SHAPES, free_parts, reduced_lines
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import proportions
from sheetoflight.model.rig import Rig

_LEAST_PX2 = 1e-12
"""Exact points are known to a millionth of a pixel."""


def board_variances(rig: Rig, state: RigState) -> Array:
    """First variances ``(6,)`` of the noise components; NaN for those that boards do not show.

    Parameters
    ----------
    rig : Rig
    state : RigState
        Camera and poses that fit the boards' points.
    """
    variances = np.full(len(COMPONENTS), np.nan)
    variances[CORNER] = _points_variance(rig, state)
    if len(rig.observations.board.line):
        variances[[STRIPE, SHAPE]] = _scatter_about_lines(rig, state)
        variances[LINE] = _scatter_about_sheets(rig, state)
    return variances


def _points_variance(rig: Rig, state: RigState) -> float:
    views = rig.observations.board
    errors = point_errors(rig, state) / proportions(views.stds)[0][..., None]
    observed = 2 * int(views.seen.sum())
    freedom = observed - LOCAL_SIZE["board"] * len(views) - len(rig.free_intrinsics)
    return max(float(np.nansum(errors**2)) / max(freedom, 1), _LEAST_PX2)


def _scatter_about_lines(rig: Rig, state: RigState) -> tuple[float, float]:
    """Variance of the points about their own winding line, and of the windings, px²."""
    reduced = reduced_lines(rig.observations.board.line, state.camera)
    misses = reduced.roots[:, :, :RAY] @ reduced.lines[..., None]
    offsets = reduced.roots[:, :, :RAY] @ free_parts(reduced.lines)
    design = np.concatenate([offsets, reduced.shapes], axis=2)
    turned = np.swapaxes(design, 1, 2)
    size = np.sqrt(np.einsum("lqk,lqk->lk", design, design))[..., None]
    normal = turned @ design / size / np.swapaxes(size, 1, 2)
    windings = np.linalg.solve(normal, turned @ misses / size) / size
    rest = misses - design @ windings
    freedom = np.maximum(reduced.counts - design.shape[2], 1).sum()
    scatter = max(float(np.sum(rest**2) / freedom), _LEAST_PX2)
    return scatter, float(np.mean(windings[:, -len(SHAPES) :] ** 2))


def _scatter_about_sheets(rig: Rig, state: RigState) -> float:
    """Mean squared distance of the lines' ends from their sheets, mm²."""
    ends, laser = ends_on_boards(rig, state)
    off = np.full(ends.shape[:2], np.nan)
    for number, plane in enumerate(planes_on_boards(rig, state)):
        if plane is not None:
            off[laser == number] = ends[laser == number] @ plane[0] - plane[1]
    return float(np.nanmean(off**2)) if np.isfinite(off).any() else 0.0
