"""Recordings with one deliberate fault in what was detected; see `faults`."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.simulation.poses import (
    Recording,
    in_plane_poses,
    observed,
    photographed,
    pivot_poses,
    placed_targets,
    recorded,
)
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.visible import target_points

Stage = Literal["camera", "plane", "crossing"]
BadView = Literal["displaced", "reversed", "other stage"]


def swapped_markers(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    stage: Stage = "camera",
    view: int = 0,
) -> Observations:
    """In one view the markers are told in reversed order."""
    seen = recorded(rig, recording, rng)
    views: TargetViews = getattr(seen, stage)
    check_view(stage, view, len(views))
    uv, markers = views.uv.copy(), len(rig.target.positions)
    uv[view, :markers] = uv[view, :markers][::-1]
    return replace(seen, **{stage: replace(views, uv=uv)})


def defocus(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    stage: Stage = "plane",
    factor: float = 4.0,
) -> Observations:
    """The noise of one stage is `factor` times as large as that of the others."""
    placed = placed_targets(rig, recording, rng)
    sharp = photographed(rig.camera, placed, 0.0, rng)
    seen = photographed(rig.camera, placed, recording.pixel_std, rng)
    true, views = getattr(sharp, stage).uv, getattr(seen, stage)
    return replace(seen, **{stage: replace(views, uv=true + factor * (views.uv - true))})


def wrong_detections(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    share: float = 0.05,
    min_px: float = 3.0,
    max_px: float = 30.0,
) -> Observations:
    """A share of every stage's image points, but at least one, is displaced by `min_px` to
    `max_px` in a random direction."""
    own = rng.spawn(1)[0]
    seen = recorded(rig, recording, rng)
    changed = {}
    for stage, views in seen.stages().items():
        points = np.argwhere(views.seen)
        chosen = tuple(points[_chosen(len(points), share, own)].T)
        uv = views.uv.copy()
        uv[chosen] += _offsets(len(chosen[0]), min_px, max_px, own)
        changed[stage] = replace(views, uv=uv)
    return replace(seen, **changed)


def bad_views(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    share: float = 0.1,
    kind: BadView | None = None,
) -> Observations:
    """A share of every stage's views, but at least one, is wrong as a whole.

    Parameters
    ----------
    rig : SimulatedRig
    recording : Recording
    rng : numpy.random.Generator
    share : float
    kind : {"displaced", "reversed", "other stage"}, optional
        What is wrong: every marker is displaced by 5 to 50 px in a direction of its own; the
        markers' order is reversed; the target is in another stage's place, in the sheet
        instead of pivoting and the other way round. By default random in every view. Spots
        stay as they are.
    """
    own = rng.spawn(1)[0]
    seen = recorded(rig, recording, rng)
    kinds = get_args(BadView) if kind is None else (kind,)
    markers, changed = len(rig.target.positions), {}
    for stage, views in seen.stages().items():
        uv = views.uv.copy()
        for view in _chosen(len(views), share, own):
            wrong = kinds[own.integers(len(kinds))]
            uv[view, :markers] = _spoilt(rig, recording, uv[view, :markers], wrong, stage, own)
        changed[stage] = replace(views, uv=uv)
    return replace(seen, **changed)


def check_view(stage: str, view: int, views: int) -> None:
    """Refuse the number of a view that its stage does not have."""
    if not 0 <= view < views:
        raise InputError(
            f"stage {stage} has {views} views, and none with number {view}",
            "record more views, or choose another one",
        )


def _chosen(count: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """A share of the numbers below `count`, but at least one of them, in random order."""
    return rng.choice(count, max(1, round(share * count)), replace=False)


def _offsets(count: int, min_px: float, max_px: float, rng: np.random.Generator) -> Array:
    """Random vectors ``(count, 2)`` of a length between two limits."""
    angle, length = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(min_px, max_px, count)
    return length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _spoilt(
    rig: SimulatedRig,
    recording: Recording,
    uv: Array,
    kind: BadView,
    stage: str,
    rng: np.random.Generator,
) -> Array:
    """Image points ``(M, 2)`` of a view that is wrong as a whole."""
    if kind == "displaced":
        return uv + _offsets(len(uv), 5.0, 50.0, rng)
    if kind == "reversed":
        return uv[::-1].copy()
    poses = in_plane_poses if stage == "camera" else pivot_poses
    points = target_points(*poses(rig, 1, rng), rig.target.positions)
    return observed(rig.camera, points, recording.pixel_std, rng).uv[0]
