"""The maximum-likelihood adjustment of camera, sheet of light and target poses.

One system holds every view of every stage. Shared parameters are the camera's intrinsics, the
fixed point of the pivoting target, and the sheet of light; each view adds its own pose. What
differs between the stages is data: where a pose puts the markers, and on which shared parameters
that depends (`_pivoting`, `_lying`). The rest – projection, weights, missing markers – is common.

Parametrisation. The pivoting target is ``A + s t`` with the unit direction ``t`` moved in its
tangent plane, so that no pole exists. The sheet carries an orthonormal frame ``(e1, e2, n)``
that is turned by small rotations; a target lying in it is
``d n + x e1 + y e2 + s (cos ψ e1 + sin ψ e2)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.geometry.directions import Array, moved, tangent_basis
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import TargetViews

CAMERA = tuple(f"camera.{name}" for name in Camera.PARAMETERS)
ANCHOR = ("anchor.x", "anchor.y", "anchor.z")
PLANE = ("plane.tilt1", "plane.tilt2", "plane.d")


@dataclass(frozen=True)
class RigState:
    """Everything that is estimated.

    Parameters
    ----------
    camera : Camera
    anchor : (3,) array
        The fixed point A, mm.
    frame : (3, 3) array
        Columns e1, e2, n: two directions in the sheet of light and its normal.
    distance : float
        Distance d of the sheet from the camera, mm.
    poses : mapping from stage to array
        ``camera``: directions t ``(N, 3)``; ``plane``: x, y in mm and ψ in radians ``(N, 3)``.
    """

    camera: Camera
    anchor: Array
    frame: Array
    distance: float
    poses: Mapping[str, Array]

    @property
    def light_plane(self) -> LightPlane:
        """The sheet, its normal turned to point away from the camera."""
        sign = 1.0 if self.distance >= 0 else -1.0
        return LightPlane(sign * self.frame[:, 2], abs(self.distance))


@dataclass(frozen=True)
class _Placement:
    """Markers in the camera frame, and how they move."""

    points: Array  # (N, M, 3)
    by_local: Array  # (N, M, 3, k)
    by_shared: Array  # (N, M, 3, 3)
    columns: tuple[str, ...]


def _pivoting(state: RigState, positions: Array) -> _Placement:
    """Targets that pivot about the fixed point."""
    directions = state.poses["camera"]
    first, second = tangent_basis(directions)
    tangents = np.stack([first, second], axis=-1)
    by_local = positions[:, None, None] * tangents[:, None]
    points = state.anchor + positions[:, None] * directions[:, None, :]
    by_shared = np.broadcast_to(np.eye(3), (*points.shape, 3))
    return _Placement(points, by_local, by_shared, ANCHOR)


def _lying(state: RigState, positions: Array) -> _Placement:
    """Targets that lie in the sheet of light."""
    pose = state.poses["plane"]
    cosine, sine = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    x = pose[:, :1] + positions * cosine
    y = pose[:, 1:2] + positions * sine
    e1, e2, normal = state.frame.T
    points = x[..., None] * e1 + y[..., None] * e2 + state.distance * normal

    by_local = np.empty((*points.shape, 3))
    by_local[..., 0] = e1
    by_local[..., 1] = e2
    turned = cosine[..., None] * e2 - sine[..., None] * e1
    by_local[..., 2] = positions[:, None] * turned

    by_shared = np.empty((*points.shape, 3))
    by_shared[..., 0] = state.distance * e1 - x[..., None] * normal
    by_shared[..., 1] = state.distance * e2 - y[..., None] * normal
    by_shared[..., 2] = normal
    return _Placement(points, by_local, by_shared, PLANE)


_PLACEMENTS: dict[str, Callable[[RigState, Array], _Placement]] = {
    "camera": _pivoting,
    "plane": _lying,
}
_LOCAL_SIZE = {"camera": 2, "plane": 3}


def intrinsic_names(names: Sequence[str]) -> tuple[str, ...]:
    """Shared-parameter names of camera parameters, in `Camera.PARAMETERS` order."""
    return tuple(f"camera.{name}" for name in Camera.PARAMETERS if name in names)


def marker_points(state: RigState, stage: str, positions: Array) -> Array:
    """Markers ``(N, M, 3)`` of one stage in the camera frame, mm."""
    return _PLACEMENTS[stage](state, positions).points


class Adjustment:
    """The least-squares problem of a set of stages, for `estimation.block_least_squares.solve`.

    Parameters
    ----------
    positions : (M,) array
        Marker positions along the target, mm.
    stages : mapping from stage to TargetViews
    std : mapping from stage to (N, M) array
        Standard uncertainty of each image coordinate, px.
    free : tuple of str
        The shared parameters to estimate, of `CAMERA`, `ANCHOR` and `PLANE` in this order; all
        others are held. The poses of all views are always estimated.
    """

    def __init__(
        self,
        positions: Array,
        stages: Mapping[str, TargetViews],
        std: Mapping[str, Array],
        free: tuple[str, ...],
    ) -> None:
        self.positions = positions
        self.stages = dict(stages)
        self.parameters = free
        self._intrinsics = [i for i, name in enumerate(CAMERA) if name in free]
        self._weights = {
            stage: np.where(views.seen, 1.0 / std[stage], 0.0)[..., None]
            for stage, views in self.stages.items()
        }
        self._observed = {
            stage: np.where(views.seen[..., None], views.uv, 0.0)
            for stage, views in self.stages.items()
        }
        self._columns = {
            stage: self.columns_of([name for name in free if name in (*CAMERA, *own)])
            for stage, own in (("camera", ANCHOR), ("plane", PLANE))
            if stage in self.stages
        }

    @property
    def shared_size(self) -> int:
        """Number of shared parameters."""
        return len(self.parameters)

    @property
    def degrees_of_freedom(self) -> int:
        """Observed coordinates less estimated parameters."""
        observed = sum(2 * int(views.seen.sum()) for views in self.stages.values())
        local = sum(_LOCAL_SIZE[stage] * len(views) for stage, views in self.stages.items())
        return observed - local - self.shared_size

    def columns_of(self, names: Sequence[str]) -> np.ndarray:
        """Indices of shared parameters by name."""
        return np.array([self.parameters.index(name) for name in names], dtype=int)

    def blocks(self, state: RigState) -> list[Block]:
        """Weighted residuals (predicted minus observed) and their derivatives, by stage."""
        return [self._block(state, stage) for stage in self.stages]

    def moved(self, state: RigState, shared: Array, local: Sequence[Array]) -> RigState:
        """The state after a step, on the manifold described above."""
        parameters = state.camera.parameters.copy()
        parameters[self._intrinsics] += shared[: len(self._intrinsics)]
        if not (np.isfinite(parameters).all() and parameters[0] > 0 and parameters[1] > 0):
            return state  # an impossible camera: no gain, so the solver damps the step
        steps = dict(zip(self.stages, local, strict=True))
        poses = dict(state.poses)
        if "camera" in steps:
            poses["camera"] = moved(state.poses["camera"], steps["camera"])
        if "plane" in steps:
            poses["plane"] = state.poses["plane"] + steps["plane"]
        step = dict(zip(self.parameters, shared, strict=True))
        e1, e2, _ = state.frame.T
        turn = step.get("plane.tilt1", 0.0) * e2 - step.get("plane.tilt2", 0.0) * e1
        return replace(
            state,
            camera=state.camera.with_parameters(parameters),
            anchor=state.anchor + np.array([step.get(name, 0.0) for name in ANCHOR]),
            frame=rotation(turn) @ state.frame,
            distance=state.distance + step.get("plane.d", 0.0),
            poses=poses,
        )

    def residuals_px(self, state: RigState) -> dict[str, Array]:
        """Observed minus predicted image points ``(N, M, 2)`` by stage; NaN where not seen."""
        return {
            stage: views.uv - state.camera.project(marker_points(state, stage, self.positions))
            for stage, views in self.stages.items()
        }

    def _block(self, state: RigState, stage: str) -> Block:
        placed = _PLACEMENTS[stage](state, self.positions)
        uv, by_point, by_camera = state.camera.project_with_jacobians(
            placed.points, self._intrinsics
        )
        weights = self._weights[stage]
        residuals = (uv - self._observed[stage]) * weights
        by_point = by_point * weights[..., None]
        own = [i for i, name in enumerate(placed.columns) if name in self.parameters]
        by_shared = np.concatenate(
            [by_camera * weights[..., None], by_point @ placed.by_shared[..., own]], axis=-1
        )
        count, markers = residuals.shape[:2]
        return Block(
            residuals=residuals.reshape(count, 2 * markers),
            by_shared=by_shared.reshape(count, 2 * markers, -1),
            columns=self._columns[stage],
            by_local=(by_point @ placed.by_local).reshape(count, 2 * markers, -1),
        )
