"""Which picture to take next: the one that tells most about what is known least.

Candidates are targets turned about the fixed point into all directions, and targets laid into
each sheet at places all over the picture. What a candidate would add to the information on the
shared parameters follows from its predicted image; its pose is unknown and eliminated like any
other's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_DIRECTIONS = 150
_PLACES = (6, 4)
_TURNS = 8
_VAGUE = 1.0
"""Relative standard uncertainty (radians for angles) that stands for knowing nothing."""


@dataclass(frozen=True)
class Candidates:
    """Views that could be taken in one stage.

    Parameters
    ----------
    stage : {"camera", "plane"}
    poses : (N, k) array
        As in `RigState.poses`.
    laser : int
        In whose sheet the targets lie, in stage plane.
    information : (N, P, P) array
        What each would add on the shared parameters.
    points : (N, M, 3) array
        The markers, mm, camera frame.
    """

    stage: str
    poses: Array
    laser: int
    information: Array
    points: Array


@dataclass(frozen=True)
class NextView:
    """The most useful view to take next.

    Parameters
    ----------
    stage : str
    laser : str
        In whose sheet the target is to lie, in stage plane.
    points : (M, 3) array
        Where its markers would be, mm, camera frame.
    uv : (M, 2) array
        Where they would be seen, px.
    gain : float
        Share of the uncertainty (a sum of relative variances) that it would take away.
    """

    stage: str
    laser: str
    points: Array
    uv: Array
    gain: float

    @property
    def in_words(self) -> str:
        """Where to hold the target, as a person can do it."""
        first, last = self.uv[0], self.uv[-1]
        across = np.degrees(np.arctan2(first[1] - last[1], last[0] - first[0])) % 360
        along = self.points[-1] - self.points[0]
        lean = np.degrees(np.arcsin(np.clip(along[2] / np.linalg.norm(along), -1, 1)))
        side = "away from" if lean >= 0 else "towards"
        turned = (
            f"pointing {_direction_name(across)} in the picture ({across:.0f}° from right, "
            f"anticlockwise) and leaning {abs(lean):.0f}° {side} the camera"
        )
        if self.stage == "camera":
            return f"turn the target about marker 0, {turned}"
        middle = self.uv.mean(axis=0)
        return (
            f"lay the target into the sheet of {self.laser} with its middle at pixel "
            f"({middle[0]:.0f}, {middle[1]:.0f}), {turned}"
        )


def _direction_name(degrees: float) -> str:
    names = ("right", "up and right", "up", "up and left", "left", "down and left", "down",
             "down and right")  # fmt: skip
    return names[round(degrees / 45.0) % 8]


def next_view(
    rig: Rig,
    state: RigState,
    noise: NoiseModel,
    parameters: tuple[str, ...],
    information: Array,
    importance: Array,
    stage: str | None = None,
) -> NextView | None:
    """The candidate that lowers the weighted sum of variances most; None where none can be seen.

    Parameters
    ----------
    rig : Rig
    state : RigState
    noise : NoiseModel
    parameters : tuple of str
        The P shared parameters.
    information : (P, P) array
        What is known now; may be singular.
    importance : (P, P) array
        Positive semi-definite; the trace of its product with the covariance is to become small.
    stage : str, optional
        The only stage to look at, if any of its candidates can be seen.
    """
    every = list(all_candidates(rig, state, noise, parameters))
    chosen = [candidates for candidates in every if candidates.stage == stage] or every
    prior = information + np.diag(vague_information(state, parameters))
    covariance = np.linalg.inv(prior)
    now = float(np.sum(importance * covariance))
    best: NextView | None = None
    for candidates in chosen:
        after = np.linalg.inv(prior + candidates.information)
        gains = 1.0 - np.einsum("ij,nij->n", importance, after) / now
        top = int(np.argmax(gains))
        if best is None or gains[top] > best.gain:
            points = candidates.points[top]
            best = NextView(
                candidates.stage,
                rig.lasers[candidates.laser],
                points,
                state.camera.project(points),
                float(gains[top]),
            )
    return best


def vague_information(state: RigState, parameters: Sequence[str]) -> Array:
    """Information ``(P,)`` of knowing each parameter's order of magnitude at most."""
    return np.array([1.0 / (_VAGUE * size_of(state, name)) ** 2 for name in parameters])


def size_of(state: RigState, parameter: str) -> float:
    """The size against which a parameter's uncertainty is large or small."""
    owner, part = parameter.split(".")
    if owner == "camera":
        focal = state.camera.alpha
        return {"alpha": focal, "beta": state.camera.beta, "gamma": focal, "u0": focal,
                "v0": focal}.get(part, _distortion_size(state, part))  # fmt: skip
    if owner == "anchor":
        return float(np.linalg.norm(state.anchor))
    if part == "d":
        return float(max(abs(state.distances[int(owner.removeprefix("sheet"))]), 1e-9))
    return 1.0


def _distortion_size(state: RigState, part: str) -> float:
    """A coefficient that moves the farthest corner of the picture by its distance from the
    principal point."""
    camera = state.camera
    corner = np.array(camera.image_size) / (2.0 * camera.alpha)
    radius = float(np.hypot(*corner))
    return radius ** -{"k1": 2, "k2": 4, "k3": 6}.get(part, 1)


def all_candidates(
    rig: Rig, state: RigState, noise: NoiseModel, parameters: tuple[str, ...]
) -> Iterator[Candidates]:
    """Views that could be taken in each stage, all their markers in the picture."""
    if any(name.startswith("anchor.") for name in parameters):
        yield from _visible(rig, state, noise, parameters, "camera", _sphere(_DIRECTIONS), 0)
    for laser in range(len(state.distances)):
        poses = _laid_out(rig, state, laser)
        yield from _visible(rig, state, noise, parameters, "plane", poses, laser)


def _visible(
    rig: Rig,
    state: RigState,
    noise: NoiseModel,
    parameters: tuple[str, ...],
    stage: str,
    poses: Array,
    laser: int,
) -> Iterator[Candidates]:
    markers = len(rig.target.markers_mm)
    names = tuple(str(i) for i in range(len(poses)))
    lasers = np.full(len(poses), laser)
    everywhere = TargetViews(names, np.zeros((len(poses), markers, 2)), laser=lasers)
    there = state.with_poses(stage, poses)
    even = replace(noise, proportions={stage: np.ones((len(poses), markers))})
    adjustment = even.adjustment(rig, {stage: everywhere}, parameters)
    points = adjustment.placed(there, stage).points
    uv = state.camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = (uv >= 0) & (uv <= np.array(rig.image_size) - 1.0)
    good = inside.all(axis=(1, 2)) & (points[..., 2] > 0).all(axis=1)
    if not good.any():
        return
    views = TargetViews(tuple(np.array(names)[good]), uv[good], laser=lasers[good])
    there = state.with_poses(stage, poses[good])
    even = replace(noise, proportions={stage: np.ones((int(good.sum()), markers))})
    adjustment = even.adjustment(rig, {stage: views}, parameters)
    (group,) = even.contrasts(adjustment, there, {})
    weighted = np.linalg.solve(group.covariance(noise.variances), group.by_shared)
    own = np.swapaxes(group.by_shared, 1, 2) @ weighted
    information = np.zeros((len(own), len(parameters), len(parameters)))
    information[:, group.columns[:, None], group.columns] = own
    yield Candidates(stage, poses[good], laser, information, points[good])


def _sphere(count: int) -> Array:
    """Directions ``(count, 3)`` spread evenly: Fibonacci's lattice."""
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _laid_out(rig: Rig, state: RigState, laser: int) -> Array:
    """Poses ``(N, 3)`` of targets in a sheet, their middles on a grid over the picture, not
    farther away than three times the distance of what was seen."""
    width, height = rig.image_size
    u, v = np.meshgrid(
        (np.arange(_PLACES[0]) + 0.5) * width / _PLACES[0],
        (np.arange(_PLACES[1]) + 0.5) * height / _PLACES[1],
    )
    rays = state.camera.unproject(np.stack([u.ravel(), v.ravel()], axis=1))
    frame = state.frames[laser]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = state.distances[laser] / (rays @ frame[:, 2])
    farthest = 3.0 * max(abs(float(state.distances[laser])), float(np.linalg.norm(state.anchor)))
    good = (depth > 0) & (depth < farthest)
    flat = (rays[good] * depth[good, None]) @ frame[:, :2]
    angles = np.arange(_TURNS) * 2.0 * np.pi / _TURNS
    half = 0.5 * rig.target.positions[-1]
    places = [
        np.column_stack([flat - half * np.array([np.cos(a), np.sin(a)]), np.full(len(flat), a)])
        for a in angles
    ]
    return np.concatenate(places) if len(flat) else np.empty((0, 3))
