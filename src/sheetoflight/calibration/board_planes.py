"""Where the lines of light lie on the boards, and the planes through them."""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.rig import Rig

_ROBUST_ROUNDS = 10
_FORGIVEN = 3.0
"""Distances from the plane, in medians, beyond which a line's points have less and less weight."""


def on_boards(rig: Rig, state: RigState) -> Array:
    """The points of the lines ``(P, 3)``, mm, camera frame: where their rays meet the boards' faces;
    NaN where they do not."""
    assert rig.board is not None
    line = rig.observations.board.line
    rays = state.camera.unproject(line.uv)
    pose, face = state.poses["board"][line.view], rig.board.faces[line.face]
    normal = np.einsum("pij,pj->pi", pose[:, :, :3], face[:, :3])
    offset = face[:, 3] + np.einsum("pi,pi->p", normal, pose[:, :, 3])
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = offset / np.einsum("pi,pi->p", normal, rays)
    return np.where(depth > 0, depth, np.nan)[:, None] * rays


def in_board_frame(state: RigState, line: LinePixels, points: Array) -> Array:
    """Points ``(P, 3)`` of the camera frame in the frames of their views' boards, mm."""
    pose = state.poses["board"][line.view]
    return np.einsum("pji,pj->pi", pose[:, :, :3], points - pose[:, :, 3])


def planes_on_boards(rig: Rig, state: RigState) -> list[tuple[Array, float] | None]:
    """For each laser the plane through its line's points on the boards; None where fewer than two
    views show its line."""
    line, points = rig.observations.board.line, on_boards(rig, state)
    there = np.isfinite(points).all(axis=1)
    planes: list[tuple[Array, float] | None] = []
    for laser in range(len(rig.lasers)):
        own = there & (line.laser == laser)
        few = len(np.unique(line.view[own])) < 2
        planes.append(None if few else _agreed_plane(points[own], line.view[own]))
    return planes


def _agreed_plane(points: Array, view: np.ndarray) -> tuple[Array, float]:
    """The plane that most lines agree with: every line counts once, and less the farther it lies
    off (Cauchy's weights)."""
    share = 1.0 / np.bincount(view)[view]
    weights = share
    normal, distance = np.array([0.0, 0.0, 1.0]), 0.0
    for _ in range(_ROBUST_ROUNDS):
        middle = (weights @ points) / weights.sum()
        offsets = points - middle
        normal = np.linalg.eigh(offsets.T @ (weights[:, None] * offsets))[1][:, 0]
        off = np.abs(offsets @ normal)
        scale = max(float(np.median(off)), 1e-9)
        weights = share / (1.0 + (off / (_FORGIVEN * scale)) ** 2)
        distance = float(normal @ middle)
    return (normal, distance) if distance >= 0 else (-normal, -distance)
