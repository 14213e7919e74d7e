"""How a sheet through control points moves with what these hang on.

A control point hangs on things of its own view alone – the pose, a line of light, the picture of
some known points – so that central differences with all views changed at once tell the motions of
all control points, and the plane's slopes by them put these together view by view.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sheetoflight.calibration.control_forms import ControlForm, Sights
from sheetoflight.calibration.rig_state import CAMERA, RigState
from sheetoflight.geometry.directions import Array

_POSE_STEPS = (1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3)
"""Turns in radians and shifts in mm: small beside what bends, large beside rounding."""

_STEP_PX = 0.01

_CAMERA_STEP = 1e-4
"""Step of the camera's parameters, as a part of them."""


def plane_slopes(points: Array, frame: Array) -> Array:
    """How the total least-squares plane through points moves with each of them.

    With the centroid μ, ``y = X − μ``, the scatter ``S = Σ y yᵀ`` and its eigenvector n of the
    least eigenvalue λ, the first order of ``S n = λ n`` in the plane's directions F is
    ``(Fᵀ S F − λ) t = −Fᵀ δS n`` for the tilts t, and ``δd = n · δμ + μ · F t``.

    Parameters
    ----------
    points : (K, 3) array
        mm; rows of NaN are no part of it.
    frame : (3, 3) array
        Columns e1, e2, n, with ``n · μ >= 0``.

    Returns
    -------
    (3, K, 3) array
        Of tilt1 and tilt2, radians per mm, and of the distance; 0 for what is no part.
    """
    there = np.asarray(np.isfinite(points).all(axis=1))
    middle = points[there].mean(axis=0)
    offset = np.where(there[:, None], points - middle, 0.0)
    flat, normal = frame[:, :2], frame[:, 2]
    off = offset @ normal
    matrix = (offset @ flat).T @ (offset @ flat) - off @ off * np.eye(2)
    pull = (offset @ flat).T[:, :, None] * normal + flat.T[:, None, :] * off[:, None]
    tilts = -np.linalg.solve(matrix, pull.reshape(2, -1)).reshape(pull.shape)
    distance = normal / there.sum() + np.einsum("j,jki->ki", middle @ flat, tilts)
    return np.where(there[:, None], np.concatenate([tilts, distance[None]]), 0.0)


def moved_by(
    form: ControlForm, slopes: Array, changed: Callable[[float], Sights], step: float
) -> Array:
    """``(3, K)``: how the sheet moves, by way of each control point, with a change of the sights.

    Parameters
    ----------
    form : ControlForm
    slopes : (3, K, 3) array
        By `plane_slopes`.
    changed : callable
        The sights after a change of given size.
    step : float
        Size for the central differences.
    """
    above, below = (form.place(changed(h)).points for h in (step, -step))
    return np.einsum("qki,ki->qk", slopes, np.nan_to_num((above - below) / (2.0 * step)))


def by_poses(form: ControlForm, slopes: Array, state: RigState) -> Array:
    """``(3, N, 6)``: by the views' poses, a turn in radians and a shift in mm each."""
    count = len(state.poses["board"])
    found = np.zeros((len(_POSE_STEPS), count, len(slopes)))
    for k, step in enumerate(_POSE_STEPS):

        def turned(size: float, k: int = k) -> Sights:
            steps = np.zeros((count, len(_POSE_STEPS)))
            steps[:, k] = size
            beside = state.moved({}, {"board": steps})
            assert beside is not None  # the camera stays
            return replace(form.sights, poses=beside.poses["board"])

        np.add.at(found[k], form.view, moved_by(form, slopes, turned, step).T)
    return found.transpose(2, 1, 0)


def by_picture(form: ControlForm, slopes: Array, views: int, points: int) -> Array:
    """``(3, N, 2M)``: by the picture of M known points, per px, the poses held."""
    found = np.zeros((views, points, 2, len(slopes)))
    for slot, axis in np.ndindex(*form.sights.known_uv.shape[1:]):

        def seen(size: float, slot: int = slot, axis: int = axis) -> Sights:
            uv = form.sights.known_uv.copy()
            uv[:, slot, axis] += size
            return replace(form.sights, known_uv=uv)

        place = (form.view, form.known[:, slot], np.full(len(form.view), axis))
        np.add.at(found, place, moved_by(form, slopes, seen, _STEP_PX).T)
    return found.reshape(views, 2 * points, -1).transpose(2, 0, 1)


def by_camera(form: ControlForm, slopes: Array, names: tuple[str, ...]) -> Array:
    """``(3, P)``: by parameters of the camera, the poses held."""
    found = np.zeros((len(slopes), len(names)))
    base = form.sights.camera.parameters
    for column, name in enumerate(names):
        index = CAMERA.index(name)

        def seen_through(size: float, index: int = index) -> Sights:
            parameters = base + size * (np.arange(len(base)) == index)
            return replace(form.sights, camera=form.sights.camera.with_parameters(parameters))

        step = _CAMERA_STEP * max(abs(float(base[index])), 1e-2)
        found[:, column] = moved_by(form, slopes, seen_through, step).sum(axis=1)
    return found
