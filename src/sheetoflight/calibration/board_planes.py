"""Where the lines of light lie on the boards, and the planes through them."""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.lines_on_boards import reduced_lines
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.rig import Rig

_ROBUST_ROUNDS = 10
_FORGIVEN = 3.0
"""Distances from the plane, in medians, beyond which a line has less and less weight."""


def faces_in_space(
    board: Board, poses: Array, view: np.ndarray, face: np.ndarray
) -> tuple[Array, Array]:
    """The planes ``m · X = c`` of boards' faces in the camera frame: m ``(K, 3)``, c ``(K,)``.

    Parameters
    ----------
    board : Board
    poses : (N, 3, 4) array
        camera_from_target of the views.
    view, face : (K,) int array
        Which face in which view.
    """
    pose, own = poses[view], board.faces[face]
    normal = np.einsum("kij,kj->ki", pose[:, :, :3], own[:, :3])
    return normal, own[:, 3] + np.einsum("ki,ki->k", normal, pose[:, :, 3])


def on_faces(rays: Array, normal: Array, offset: Array) -> Array:
    """Where rays ``(K, ..., 3)`` meet planes ``m · X = c``, mm; NaN where they do not."""
    shape = (len(rays),) + (1,) * (rays.ndim - 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = offset.reshape(shape) / np.einsum("k...i,ki->k...", rays, normal)
    return np.where(depth > 0, depth, np.nan)[..., None] * rays


def ends_on_boards(rig: Rig, state: RigState) -> tuple[Array, np.ndarray]:
    """The ends of the lines on the boards ``(L, 2, 3)``, mm, camera frame, and their lasers."""
    assert rig.board is not None
    lines = reduced_lines(rig.observations.board.line, state.camera)
    normal, offset = faces_in_space(rig.board, state.poses["board"], lines.view, lines.face)
    return on_faces(lines.ends, normal, offset), lines.laser


def planes_on_boards(rig: Rig, state: RigState) -> list[tuple[Array, float] | None]:
    """For each laser the plane through its lines on the boards; None where there are fewer than
    two."""
    if not len(rig.observations.board.line):
        return [None] * len(rig.lasers)
    ends, laser = ends_on_boards(rig, state)
    there = np.isfinite(ends).all(axis=(1, 2))
    planes: list[tuple[Array, float] | None] = []
    for number in range(len(rig.lasers)):
        own = there & (laser == number)
        planes.append(_agreed_plane(ends[own]) if own.sum() >= 2 else None)
    return planes


def _agreed_plane(ends: Array) -> tuple[Array, float]:
    """The plane that most lines ``(L, 2, 3)`` agree with: the farther one lies off, the less it
    counts (Cauchy's weights)."""
    points = ends.reshape(-1, 3)
    weights = np.ones(len(points))
    normal, distance = np.array([0.0, 0.0, 1.0]), 0.0
    for _ in range(_ROBUST_ROUNDS):
        middle = weights @ points / weights.sum()
        offsets = points - middle
        normal = np.linalg.eigh(offsets.T @ (weights[:, None] * offsets))[1][:, 0]
        off = np.abs(offsets @ normal)
        scale = max(float(np.median(off)), 1e-9)
        weights = 1.0 / (1.0 + (off / (_FORGIVEN * scale)) ** 2)
        distance = float(normal @ middle)
    return (normal, distance) if distance >= 0 else (-normal, -distance)


def point_errors(rig: Rig, state: RigState) -> Array:
    """Observed minus predicted points of the boards ``(N, M, 2)``, px; NaN where not seen."""
    assert rig.board is not None
    pose = state.poses["board"]
    points = rig.board.points @ np.swapaxes(pose[:, :, :3], 1, 2) + pose[:, None, :, 3]
    return np.asarray(rig.observations.board.uv - state.camera.project(points))
