"""Focal length, radial distortion and pose from one view, the principal point being known.

R. Y. Tsai, "A versatile camera calibration technique for high-accuracy 3D machine vision metrology
using off-the-shelf TV cameras and lenses", IEEE J. Robotics and Automation RA-3(4), 1987. Radial
distortion moves an image point along its ray from the principal point, so the direction of that
ray is free of it: the radial alignment constraint. It gives the rotation and two parts of the
translation linearly; focal length, depth and distortion follow in a second stage.

Tsai's κ leads from the distorted to the ideal image, ``r_ideal = r (1 + κ r²)``, Brown's k1 the
other way. To first order ``k1 = −κ beta²`` (r in px); that is used for a start, and the second
stage then estimates k1 itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised

_ROUNDING = 1e-9
_APART = 3.0
"""How much worse than the best solution of the linear equations the next one must fit."""

_DISTORTIONS = np.linspace(-0.4, 0.4, 9)
"""κ r² at the outermost point that are tried for a start."""

_LEAST_DAMPING = 1e-12
"""Keeps the equations regular where two parameters do the same."""

_STEPS = 30
_PARALLEL = 1e-6
"""Singular value of the image's derivatives by focal length, depth and distortion, each of length
1, below which no digits of them are left: a tilt is known to the root of rounding only."""

_LOOSE = 0.3
"""Relative standard uncertainty of a focal length that is no longer one."""


@dataclass(frozen=True)
class TsaiCamera:
    """What one view gives.

    Parameters
    ----------
    alpha, beta : float
        Focal length along u and v, px.
    k1 : float
        Radial distortion by `Camera`'s formula.
    camera_from_target : (3, 4) array
        ``[R t]``, t in mm.
    """

    alpha: float
    beta: float
    k1: float
    camera_from_target: Array


def tsai_camera(
    points: Array, uv: Array, principal_point: Array, aspect: float = 1.0
) -> TsaiCamera | None:
    """Camera and pose from one view of known points, with radial distortion.

    Parameters
    ----------
    points : (M, 3) array
        Known points in the target's frame, mm; they may lie in one plane.
    uv : (M, 2) array
        Their image points, px; NaN where not seen.
    principal_point : (2,) array
        ``(u0, v0)`` in px, the centre of the distortion.
    aspect : float
        ``alpha / beta``, for points in one plane, which leave it open; others give it.

    Returns
    -------
    TsaiCamera, or None
        Where too few points are seen (5 in a plane, 7 in space), they leave the alignment
        equations open, or the focal length: a plane that faces the camera looks the same from
        near by and from afar.
    """
    seen = np.isfinite(uv).all(axis=1)
    if seen.sum() < 5:
        return None
    middle = points[seen].mean(axis=0)
    x, offset = points[seen] - middle, uv[seen] - principal_point
    spread, axes = np.linalg.svd(x, full_matrices=False)[1:]
    flat = spread[2] <= _ROUNDING * spread[0]
    if flat:
        axes[2] = np.cross(axes[0], axes[1])
        candidates = _flat_alignments(x @ axes[:2].T, offset * [1.0 / aspect, 1.0])
        candidates = [_Alignment(c.rotation @ axes, c.aside, aspect) for c in candidates]
    else:
        candidates = _alignments(x, offset)
    found = [_second_stage(x, offset, candidate) for candidate in candidates]
    best = min((f for f in found if f is not None), key=lambda f: f.cost, default=None)
    return None if best is None else best.camera(middle)


@dataclass(frozen=True)
class _Alignment:
    """The first stage's result: rotation, (Tx, Ty), and ``alpha / beta``."""

    rotation: Array
    aside: Array
    aspect: float


@dataclass(frozen=True)
class _Lens:
    """The second stage's result: beta, Tz and k1 of an alignment, and the sum of squares, px²."""

    alignment: _Alignment
    parameters: Array
    cost: float

    def camera(self, middle: Array) -> TsaiCamera:
        beta, depth, k1 = (float(p) for p in self.parameters)
        R = self.alignment.rotation
        t = np.append(self.alignment.aside, depth) - R @ middle
        return TsaiCamera(self.alignment.aspect * beta, beta, k1, np.column_stack([R, t]))


def _null_vector(rows: Array) -> Array | None:
    """The vector that equations ``(M, P)`` map to zero, or None where there is no single one."""
    if len(rows) < rows.shape[1] - 1:
        return None
    scale = np.linalg.norm(rows, axis=0)
    if (scale <= 0).any():
        return None
    _, size, vectors = np.linalg.svd(np.linalg.qr(rows / scale, mode="r"))
    last = size[rows.shape[1] - 1] if len(size) == rows.shape[1] else 0.0
    if size[rows.shape[1] - 2] < max(_ROUNDING * size[0], _APART * last):
        return None
    return vectors[-1] / scale


def _alignments(x: Array, offset: Array) -> list[_Alignment]:
    """Points in space: ``x_d (r2 · X + Ty) = y_d s (r1 · X + Tx)`` with ``s = alpha / beta``.

    Tsai's eq. 16, without dividing by Ty, which may be zero; s from the lengths of r1 and r2
    (eq. 18).
    """
    with_one = np.column_stack([x, np.ones(len(x))])
    found = _null_vector(np.concatenate([offset[:, 1:] * with_one, -offset[:, :1] * with_one], 1))
    if found is None:
        return []
    along, across = found.reshape(2, 4)
    lengths = np.linalg.norm(along[:3]), np.linalg.norm(across[:3])
    if min(lengths) <= 0:
        return []
    whole = np.stack([along / lengths[0], across / lengths[1]])
    whole *= _sign(np.sum(offset[:, 0] * (with_one @ whole[0])))
    u, _, vt = np.linalg.svd(whole[:, :3], full_matrices=False)
    first, second = u @ vt
    R = np.stack([first, second, np.cross(first, second)])
    return [_Alignment(R, whole[:, 3], float(lengths[0] / lengths[1]))]


def _flat_alignments(x: Array, offset: Array) -> list[_Alignment]:
    """Points ``(M, 2)`` in a plane: ``x_d (r21 X + r22 Y + Ty) = y_d (r11 X + r12 Y + Tx)``.

    Tsai's eqs. 10–12. The upper left 2 x 2 part A of a rotation has the singular values 1 and
    ``|r33|``, which fixes the scale; the rest of the first two rows is ``b bᵀ = 1 − A Aᵀ``, with
    two signs that only perspective tells apart.
    """
    with_one = np.column_stack([x, np.ones(len(x))])
    found = _null_vector(np.concatenate([offset[:, 1:] * with_one, -offset[:, :1] * with_one], 1))
    if found is None:
        return []
    whole = found.reshape(2, 3) * _sign(np.sum(offset[:, 0] * (with_one @ found[:3])))
    u, size, _ = np.linalg.svd(whole[:, :2])
    whole = whole / size[0]
    tilt = np.sqrt(1.0 - (size[1] / size[0]) ** 2) * u[:, 1]
    rotations = [_completed(np.column_stack([whole[:, :2], sign * tilt])) for sign in (1.0, -1.0)]
    return [_Alignment(R, whole[:, 2], 1.0) for R in rotations]


def _completed(rows: Array) -> Array:
    """A rotation from its first two rows ``(2, 3)``."""
    first, second = normalised(rows)
    return np.stack([first, second, np.cross(first, second)])


def _sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _second_stage(x: Array, offset: Array, alignment: _Alignment) -> _Lens | None:
    """Focal length, depth and distortion of an alignment."""
    turned = x @ alignment.rotation.T
    turned[:, :2] += alignment.aside
    upright = offset * [1.0 / alignment.aspect, 1.0]
    starts = [_start(turned, upright, part) for part in _DISTORTIONS]
    lenses = [(_cost(turned, upright, s), s) for s in starts if s is not None]
    if not lenses:
        return None
    parameters = _refined(turned, upright, min(lenses, key=lambda lens: lens[0])[1])
    residuals, slopes = _residuals(turned, upright, parameters)
    return _trusted(alignment, parameters, residuals, slopes)


def _start(turned: Array, upright: Array, part: float) -> Array | None:
    """beta, Tz and k1 for a given ``κ r²`` at the outermost point.

    ``(1 + κ r²) y_d (r3 · X + Tz) = beta (r2 · X + Ty)``, and alike for x: Tsai's eq. 15.
    """
    square = np.sum(upright**2, axis=1)
    ideal = (1.0 + part * square / square.max())[:, None] * upright
    rows = np.stack([turned[:, :2].ravel(), -ideal.ravel()], axis=1)
    scale = np.linalg.norm(rows, axis=0)
    size = np.linalg.svd(rows / scale, compute_uv=False)
    if size[1] < _ROUNDING:
        return None
    right = (ideal * turned[:, 2:]).ravel()
    beta, depth = np.linalg.lstsq(rows / scale, right, rcond=None)[0] / scale
    if beta <= 0 or (turned[:, 2] + depth <= 0).any():
        return None
    return np.array([beta, depth, -part * beta**2 / square.max()])


def _residuals(turned: Array, upright: Array, parameters: Array) -> tuple[Array, Array]:
    """Predicted less observed image points ``(2 M,)`` px, and their derivatives ``(2 M, 3)``."""
    beta, depth, k1 = parameters
    z = (turned[:, 2] + depth)[:, None]
    xy = turned[:, :2] / z
    square = np.sum(xy**2, axis=1, keepdims=True)
    ratio = 1.0 + k1 * square
    slopes = [ratio * xy, -beta * (ratio + 2.0 * k1 * square) * xy / z, beta * square * xy]
    residuals = beta * ratio * xy - upright
    return residuals.ravel(), np.stack([s.ravel() for s in slopes], axis=1)


def _cost(turned: Array, upright: Array, parameters: Array) -> float:
    if parameters[0] <= 0 or (turned[:, 2] + parameters[1] <= 0).any():
        return np.inf
    return float(np.sum(_residuals(turned, upright, parameters)[0] ** 2))


def _refined(turned: Array, upright: Array, parameters: Array) -> Array:
    """Least squares of the image points by Levenberg's and Marquardt's method."""
    cost, damping = _cost(turned, upright, parameters), 1e-6
    for _ in range(_STEPS):
        residuals, slopes = _residuals(turned, upright, parameters)
        scale = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
        normal = (slopes / scale).T @ (slopes / scale) + damping * np.eye(3)
        step = np.linalg.solve(normal, (slopes / scale).T @ residuals) / scale
        trial = _cost(turned, upright, parameters - step)
        if trial < cost:
            damping = max(0.1 * damping, _LEAST_DAMPING)
            parameters, cost = parameters - step, trial
        else:
            damping *= 10.0
    return parameters


def _trusted(
    alignment: _Alignment, parameters: Array, residuals: Array, slopes: Array
) -> _Lens | None:
    """The lens, unless the residuals leave its focal length open."""
    scale = np.linalg.norm(slopes, axis=0)
    size, vectors = np.linalg.svd(slopes / scale, full_matrices=False)[1:]
    if size[-1] < _PARALLEL:
        return None
    freedom = max(len(residuals) - 3, 1)
    gain = float(np.linalg.norm(vectors[:, 0] / size) / scale[0])
    std = gain * float(np.linalg.norm(residuals)) / np.sqrt(freedom)
    if std > _LOOSE * parameters[0]:
        return None
    return _Lens(alignment, parameters, float(residuals @ residuals))
