"""Targets where an operator might hold them: random poses that the camera sees whole.

- Stage camera: directions about the fixed point, uniform on the sphere.
- Stage plane: middles spread evenly over the depths and, at each depth, evenly along the sheet's
  line in the picture; directions in the sheet uniform.
- Stage crossing: spots spread like the middles of stage plane, anywhere on the target but for a
  twentieth at either end; directions uniform on the sphere, 15° or more off the sheet.

Of these, those whose points are all in the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sheetoflight.calibration.planned_rig import PlannedRig
from sheetoflight.calibration.predicted_views import PredictedViews, joined, predicted_views
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised

_BATCH = 512
_BATCHES = 60
_FEWEST = 20
"""With fewer positions to choose from a plan would say little of what an operator can do."""

_LEAST_CROSSING = math.sin(math.radians(15.0))
_END_SHARE = 0.05

_WHERE = {
    "camera": ("positions of the pivoting target", "pivot_mm farther away or nearer to the axis"),
    "plane": ("positions of the target in the sheet", "other depth_mm"),
    "crossing": ("positions of a target that the sheet crosses", "other depth_mm"),
}


def random_views(
    planned: PlannedRig, stage: str, laser: int, count: int, rng: np.random.Generator
) -> PredictedViews:
    """Random views of a stage, and what each would tell.

    Parameters
    ----------
    planned : PlannedRig
    stage : {"camera", "plane", "crossing"}
    laser : int
    count : int
        So many are wanted; where they are rare, fewer are given.
    rng : Generator

    Raises
    ------
    InputError
        If hardly any pose lies wholly in the picture.
    """
    rig = planned.rig
    known = (rig, planned.state, planned.noise, planned.parameters)
    found: list[PredictedViews] = []
    for _ in range(_BATCHES):
        found.append(predicted_views(*known, stage, _DRAWN[stage](planned, laser, rng), laser))
        if sum(map(len, found)) >= count:
            break
    views = joined(found)
    if len(views) < _FEWEST:
        what, remedy = _WHERE[stage]
        of = "" if stage == "camera" or len(rig.lasers) == 1 else f" of {rig.lasers[laser]}"
        raise InputError(
            f"{len(views)} of {_BATCH * _BATCHES} random {what}{of} lie wholly in the picture",
            f"plan with a shorter target, or give {remedy} in [plan]",
        )
    return views.take(np.arange(min(count, len(views))))


def _pivoting(_: PlannedRig, __: int, rng: np.random.Generator) -> Array:
    return normalised(rng.normal(size=(_BATCH, 3)))


def _lying(planned: PlannedRig, laser: int, rng: np.random.Generator) -> Array:
    middles = points_in_sheet(planned, laser, rng) @ planned.state.frames[laser][:, :2]
    angles = rng.uniform(0.0, 2.0 * np.pi, len(middles))
    half = 0.5 * planned.rig.target.positions[-1]
    start = middles - half * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.column_stack([start, angles])


def _crossing(planned: PlannedRig, laser: int, rng: np.random.Generator) -> Array:
    spots = points_in_sheet(planned, laser, rng)
    directions = normalised(rng.normal(size=spots.shape))
    positions = planned.rig.target.positions
    along = rng.uniform(_END_SHARE, 1.0 - _END_SHARE, len(spots)) * positions[-1]
    steep = np.abs(directions @ planned.state.frames[laser][:, 2]) >= _LEAST_CROSSING
    middles = spots + (positions.mean() - along)[:, None] * directions
    return np.concatenate([middles, directions], axis=1)[steep]


_DRAWN: dict[str, Callable[[PlannedRig, int, np.random.Generator], Array]] = {
    "camera": _pivoting,
    "plane": _lying,
    "crossing": _crossing,
}


def points_in_sheet(planned: PlannedRig, laser: int, rng: np.random.Generator) -> Array:
    """Random points ``(≤ n, 3)`` of a sheet that the picture shows within the plan's depths.

    Pixels are drawn evenly. Across the lines of equal depth one pixel covers a depth in
    proportion to Z², so a point is kept with odds in proportion to Z².
    """
    state, (nearest, farthest) = planned.state, planned.depth_mm
    size = np.array(state.camera.image_size)
    rays = state.camera.unproject(rng.uniform(-0.5, size - 0.5, (_BATCH, 2)))
    odds = rng.uniform(size=_BATCH)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = state.distances[laser] / (rays @ state.frames[laser][:, 2])
        kept = (depth >= nearest) & (depth <= farthest)
        kept &= odds * farthest**2 <= depth**2
    return rays[kept] * depth[kept, None]
