"""Which picture to take next: the one that tells most about what is known least.

Candidates are targets turned about the fixed point into all directions, and targets laid into
each sheet at places all over the picture. What a candidate would add to the information on the
shared parameters is predicted (`predicted_views`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.predicted_views import PredictedViews, predicted_views
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.rig import Rig

_DIRECTIONS = 150
_PLACES = (6, 4)
_TURNS = 8
_VAGUE = 1.0
"""Relative standard uncertainty (radians for angles) that stands for knowing nothing."""

_LEVEL_DEG = 3.0
"""A line that runs flatter, or a target that leans less, is told as level."""


@dataclass(frozen=True)
class NextView:
    """The most useful view to take next.

    Parameters
    ----------
    stage : str
    laser : str
        In whose sheet the target is to lie, in stage plane.
    points : (M, 3) array
        Where its markers would be, in stage crossing the spot behind them; mm, camera frame.
    uv : (M, 2) array
        Where they would be seen, px.
    gain : float
        Share of the uncertainty, as a variance, that it would take away.
    typical_gain : float
        The same of the median candidate.
    predicted : PredictedViews
        What it would tell, as one view.
    """

    stage: str
    laser: str
    points: Array
    uv: Array
    gain: float
    typical_gain: float
    predicted: PredictedViews

    @property
    def in_words(self) -> str:
        """Where to hold the target, as a person can do it who looks at the picture."""
        other = len(self.uv) - (2 if self.stage == "crossing" else 1)
        first, last = self.uv[0], self.uv[other]
        run = running(float(last[0] - first[0]), float(last[1] - first[1]))
        ends = f"marker 0 at {_pixel(first)}, marker {other} at {_pixel(last)}"
        if self.stage == "camera":
            return (
                f"turn the target about marker 0 until its image runs from marker 0 {run}, "
                f"marker {other} at {_pixel(last)} and {self._lean(other)}"
            )
        if self.stage == "crossing":
            return (
                f"hold the target so that the sheet of {self.laser} crosses it at "
                f"{_pixel(self.uv[-1])}: {ends}, this one {self._lean(other)}"
            )
        return (
            f"lay the target into the sheet of {self.laser} with its middle at "
            f"{_pixel(0.5 * (first + last))}, its image running from marker 0 {run}: {ends}"
        )

    def _lean(self, other: int) -> str:
        along = self.points[other] - self.points[0]
        lean = math.degrees(math.asin(np.clip(along[2] / np.linalg.norm(along), -1, 1)))
        if abs(lean) < _LEVEL_DEG:
            return "as far from the camera as marker 0"
        side, turned = ("farther from", "away from") if lean > 0 else ("nearer to", "towards")
        return (
            f"{abs(along[2]):.0f} mm {side} the camera than marker 0, "
            f"the target leaning {abs(lean):.0f}° {turned} the camera"
        )


def _pixel(uv: Array) -> str:
    return f"pixel ({uv[0]:.0f}, {uv[1]:.0f})"


def running(right_px: float, down_px: float) -> str:
    """A direction in the picture in words.

    Examples
    --------
    >>> running(100.0, 70.0)
    'to the right, 35° below the horizontal'
    >>> running(-1.0, 0.0), running(0.0, -1.0)
    ('horizontally to the left', 'straight up')
    """
    angle = math.degrees(math.atan2(abs(down_px), abs(right_px)))
    side, height = ("right" if right_px >= 0 else "left"), ("below" if down_px >= 0 else "above")
    if angle < _LEVEL_DEG:
        return f"horizontally to the {side}"
    if angle > 90.0 - _LEVEL_DEG:
        return "straight down" if down_px >= 0 else "straight up"
    return f"to the {side}, {angle:.0f}° {height} the horizontal"


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
        The only stage to look at.
    """
    every = list(all_candidates(rig, state, noise, parameters))
    chosen = [c for c in every if stage is None or c.stage == stage]
    if not chosen:
        return None
    prior = information + np.diag(vague_information(state, parameters))
    now = float(np.sum(importance * np.linalg.inv(prior)))
    gains = []
    for candidates in chosen:
        after = np.linalg.inv(prior + candidates.information)
        gains.append(1.0 - np.einsum("ij,nij->n", importance, after) / now)
    return most_useful(rig, chosen, gains)


def most_useful(
    rig: Rig, candidates: Sequence[PredictedViews], gains: Sequence[Array]
) -> NextView | None:
    """The candidate of greatest gain; None where there is none.

    Parameters
    ----------
    rig : Rig
    candidates : sequence of PredictedViews
    gains : sequence of (N,) arrays
        Of each candidate, in the same order.
    """
    if not candidates:
        return None
    best = max(range(len(gains)), key=lambda place: float(gains[place].max()))
    views, top = candidates[best], int(np.argmax(gains[best]))
    return NextView(
        views.stage,
        rig.lasers[views.laser],
        views.points[top],
        views.uv[top],
        float(gains[best][top]),
        float(np.median(np.concatenate(gains))),
        views.take(np.array([top])),
    )


def vague_information(state: RigState, parameters: Sequence[str]) -> Array:
    """Information ``(P,)`` of knowing each parameter's order of magnitude at most."""
    return np.array([1.0 / (_VAGUE * size_of(state, name)) ** 2 for name in parameters])


DISTORTION_POWERS = {"k1": 2, "k2": 4, "p1": 1, "p2": 1, "k3": 6}
"""Power of the distance from the principal point with which a coefficient of the lens moves a
point, as a part of that distance."""


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
    return radius ** -DISTORTION_POWERS.get(part, 1)


def all_candidates(
    rig: Rig,
    state: RigState,
    noise: NoiseModel,
    parameters: tuple[str, ...],
) -> Iterator[PredictedViews]:
    """Views that could be taken in each stage, all their markers in the picture."""
    if any(name.startswith("anchor.") for name in parameters):
        views = predicted_views(rig, state, noise, parameters, "camera", _sphere(_DIRECTIONS))
        if len(views):
            yield views
    for laser in range(len(state.distances)):
        poses = _laid_out(rig, state, laser)
        views = predicted_views(rig, state, noise, parameters, "plane", poses, laser)
        if len(views):
            yield views


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
