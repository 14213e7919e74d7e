"""Everything that an adjustment estimates, and how it moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sheetoflight.geometry.directions import Array, moved
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import CURVATURE_PARTS
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import SheetCurvature

CAMERA = tuple(f"camera.{name}" for name in Camera.PARAMETERS)
ANCHOR = ("anchor.x", "anchor.y", "anchor.z")
SHEET_PARTS = ("tilt1", "tilt2", "d")

LOCAL_SIZE = {"camera": 2, "plane": 3, "crossing": 5, "board": 6}
"""Parameters of its own that a view of each stage has."""


@lru_cache
def sheet_names(count: int) -> tuple[str, ...]:
    """Shared-parameter names of ``count`` sheets, numbered from 0."""
    return tuple(f"sheet{index}.{part}" for index in range(count) for part in SHEET_PARTS)


@lru_cache
def bend_names(count: int) -> tuple[str, ...]:
    """Shared-parameter names of the bends of ``count`` sheets, numbered from 0."""
    return tuple(f"sheet{index}.{part}" for index in range(count) for part in CURVATURE_PARTS)


def intrinsic_names(names: Sequence[str]) -> tuple[str, ...]:
    """Shared-parameter names of camera parameters, in `Camera.PARAMETERS` order."""
    return tuple(f"camera.{name}" for name in Camera.PARAMETERS if name in names)


@dataclass(frozen=True)
class SheetBends:
    """How sheets bend away from their planes; their axes are those of `RigState.frames`.

    Parameters
    ----------
    centres : (L, 3) array
        The points of the planes about which they bend, mm.
    per_mm : (L, 3) array
        ``kxx, kxy, kyy`` of `SheetCurvature`, 1/mm.
    """

    centres: Array
    per_mm: Array


@dataclass(frozen=True)
class RigState:
    """Everything that is estimated.

    Parameters
    ----------
    camera : Camera
    anchor : (3,) array
        The fixed point A, mm.
    frames : (L, 3, 3) array
        For each sheet of light, columns e1, e2, n: two directions in it and its normal.
    distances : (L,) array
        Distance d of each sheet from the camera, mm.
    poses : mapping from stage to array
        ``camera``: directions t ``(N, 3)``; ``plane``: x, y in mm and ψ in radians ``(N, 3)``;
        ``crossing``: the target's middle in mm and its direction ``(N, 6)``; ``board``:
        camera_from_target ``[R t]`` ``(N, 3, 4)``, t in mm.
    bends : SheetBends, optional
        Of curved sheets; all are flat where absent.
    """

    camera: Camera
    anchor: Array
    frames: Array
    distances: Array
    poses: Mapping[str, Array]
    bends: SheetBends | None = None

    def light_planes(self, names: Sequence[str]) -> tuple[LightPlane, ...]:
        """The sheets, their normals turned to point away from the camera."""
        return tuple(
            LightPlane(frame[:, 2] * sign, abs(float(distance)), name, curvature)
            for name, frame, distance, sign, curvature in zip(
                names, self.frames, self.distances, self.signs, self._curvatures(), strict=True
            )
        )

    def _curvatures(self) -> list[SheetCurvature | None]:
        if self.bends is None:
            return [None] * len(self.distances)
        bends = zip(self.bends.centres, self.frames, self.bends.per_mm, self.signs, strict=True)
        return [
            SheetCurvature(c, frame[:, :2], sign * k) if k.any() else None
            for c, frame, k, sign in bends
        ]

    @property
    def signs(self) -> Array:
        """``(L,)``: -1 for a sheet whose normal points towards the camera, else 1."""
        return np.where(self.distances >= 0, 1.0, -1.0)

    def with_poses(self, stage: str, poses: Array) -> RigState:
        """The state with other poses in one stage."""
        return replace(self, poses={**self.poses, stage: poses})

    def moved(self, shared: Mapping[str, float], local: Mapping[str, Array]) -> RigState | None:
        """The state after a step; None where no such camera exists.

        Parameters
        ----------
        shared : mapping from name to float
            Steps of shared parameters; those that are not named stay.
        local : mapping from stage to (N, k) array
        """
        parameters = self.camera.parameters + _steps(shared, CAMERA)
        if not (np.isfinite(parameters).all() and parameters[0] > 0 and parameters[1] > 0):
            return None
        steps = _steps(shared, sheet_names(len(self.distances))).reshape(-1, 3)
        turns = steps[:, :1] * self.frames[:, :, 1] - steps[:, 1:2] * self.frames[:, :, 0]
        poses = dict(self.poses)
        for stage, step in local.items():
            poses[stage] = _moved_poses(stage, poses[stage], step)
        return RigState(
            camera=self.camera.with_parameters(parameters),
            anchor=self.anchor + _steps(shared, ANCHOR),
            frames=rotation(turns) @ self.frames,
            distances=self.distances + steps[:, 2],
            poses=poses,
            bends=self._bent(shared),
        )

    def _bent(self, shared: Mapping[str, float]) -> SheetBends | None:
        if self.bends is None:
            return None
        steps = _steps(shared, bend_names(len(self.distances))).reshape(-1, 3)
        return replace(self.bends, per_mm=self.bends.per_mm + steps)


def _steps(shared: Mapping[str, float], names: Sequence[str]) -> Array:
    return np.array([shared.get(name, 0.0) for name in names])


def _moved_poses(stage: str, poses: Array, step: Array) -> Array:
    if stage == "camera":
        return moved(poses, step)
    if stage == "plane":
        return poses + step
    if stage == "board":
        turned = rotation(step[:, :3]) @ poses[:, :, :3]
        return np.concatenate([turned, poses[:, :, 3:] + step[:, 3:, None]], axis=2)
    return np.concatenate([poses[:, :3] + step[:, :3], moved(poses[:, 3:], step[:, 3:])], axis=1)
