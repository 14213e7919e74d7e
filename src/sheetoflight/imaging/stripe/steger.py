"""Centres of the line as ridges of the smoothed light, in any direction.

C. Steger, "An unbiased detector of curvilinear structures", IEEE PAMI 20(2), 1998: where the first
derivative of the light, smoothed by a Gaussian, vanishes across the direction of strongest
curvature. One Taylor step from a pixel's centre leaves up to 0.03 px; the steps are repeated here,
with the derivatives taken at the point itself, until the derivative is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.asymmetry import surroundings
from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight, Picture

_SCALES_PX = (1.0, 8.0)
_REACH_SCALES = 4.0
_CLEAR_SCALES = 3.0
_STEPS = 8
_CONVERGED_PX = 1e-4
_LONGEST_STEP_PX = 1.0
_SAMPLES_AT_ONCE = 4_000_000


def steger_centres(light: LineLight, track: Track) -> Located:
    """Zeros of the derivative across the line, smoothed as widely as the line is.

    The smoothing runs along the line too, so a centre rests on some 2 √π scales of it: its noise
    is the matched filter's divided by the square root of that, and neighbours share it.
    """
    scale = float(np.clip(np.median(track.width), *_SCALES_PX))
    uv = track.uv(track.across)
    found = [
        _ridge_points(light.picture, part, scale)
        for part in np.array_split(uv, _parts(len(uv), scale))
    ]
    ridge = _Ridge(*(np.concatenate(column) for column in zip(*found, strict=True)))
    lit = track.amplitude * (1.0 + scale**2 / (2.0 * track.width**2)) ** -1.5
    # The kernel's square integral; the pixel's box widens it.
    noise = np.sqrt(track.law.variance(lit) / (8.0 * np.pi)) / (scale**2 + 1.0 / 12.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        std = noise / -ridge.curvature
        moved = np.linalg.norm(ridge.uv - uv, axis=1)
    good = ridge.still & (ridge.curvature < 0.0) & (moved < 2.0 * track.width + 1.0)
    good &= _within(light.picture, ridge.uv, _CLEAR_SCALES * scale)
    sides = surroundings(light.picture, track, ridge.uv, ridge.across, scale)
    pull = sides.pull(track, ridge.curvature, scale)
    corrected = ridge.uv - pull[:, None] * ridge.across
    return Located(corrected, np.where(good, std, np.nan), good)


def _within(picture: Picture, uv: Array, margin: float) -> NDArray[np.bool_]:
    """Whether points lie so far inside the picture that the smoothing sees little beyond it."""
    limits = np.array(picture.shape[::-1]) - 1.0 - margin
    return np.asarray(((uv >= margin) & (uv <= limits)).all(axis=1))


@dataclass(frozen=True)
class _Ridge:
    """Points ``(N, 2)``, unit directions across, curvatures there, and whether they are at rest."""

    uv: Array
    across: Array
    curvature: Array
    still: NDArray[np.bool_]


def _parts(count: int, scale: float) -> int:
    side = 2 * int(np.ceil(_REACH_SCALES * scale)) + 3
    return max(1, int(np.ceil(count * side * side / _SAMPLES_AT_ONCE)))


def _ridge_points(picture: Picture, uv: Array, scale: float) -> tuple[Array, Array, Array, Array]:
    still = np.zeros(len(uv), dtype=bool)
    across, curvature = np.zeros_like(uv), np.zeros(len(uv))
    for _ in range(_STEPS):
        gradient, hessian = smooth_derivatives(picture, uv, scale)
        across, curvature = _strongest(hessian)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -np.sum(gradient * across, axis=1) / curvature
        step = np.clip(np.nan_to_num(step), -_LONGEST_STEP_PX, _LONGEST_STEP_PX)
        still = np.abs(step) < _CONVERGED_PX
        uv = uv + step[:, None] * across
        if still.all():
            break
    return uv, across, curvature, still


def smooth_derivatives(picture: Picture, uv: Array, scale: float) -> tuple[Array, Array]:
    """Gradient ``(N, 2)`` and Hessian ``(N, 3)`` (uu, uv, vv) of the light smoothed by a Gaussian.

    At any points ``(N, 2)``, from the pixels themselves: each counts by the integral of the
    kernel over it. The picture's border is continued.
    """
    reach = int(np.ceil(_REACH_SCALES * scale)) + 1
    base = np.rint(uv).astype(np.int64)
    steps = np.arange(-reach, reach + 1)
    columns = np.clip(base[:, :1] + steps, 0, picture.shape[1] - 1)
    rows = np.clip(base[:, 1:] + steps, 0, picture.shape[0] - 1)
    window = picture[rows[:, :, None], columns[:, None, :]].astype(float)
    by_u = _kernels(steps - (uv - base)[:, :1], scale)
    by_v = _kernels(steps - (uv - base)[:, 1:], scale)
    # rows of `table`: smoothed, first and second derivative along v; columns: along u
    table = np.swapaxes(by_v, 1, 2) @ (window @ by_u)
    gradient = np.stack([table[:, 0, 1], table[:, 1, 0]], axis=-1)
    hessian = np.stack([table[:, 0, 2], table[:, 1, 1], table[:, 2, 0]], axis=-1)
    return gradient, hessian


def _kernels(x: Array, scale: float) -> Array:
    """Gaussian and its first two derivatives by the point, over each pixel ``(N, K, 3)``."""
    right, left = (x + 0.5) / scale, (x - 0.5) / scale
    g_right, g_left = (np.exp(-0.5 * t * t) / np.sqrt(2.0 * np.pi) for t in (right, left))
    return np.stack(
        [
            ndtr(right) - ndtr(left),
            (g_left - g_right) / scale,
            (left * g_left - right * g_right) / scale**2,
        ],
        axis=-1,
    )


def _strongest(hessian: Array) -> tuple[Array, Array]:
    """Unit direction ``(N, 2)`` of the most negative curvature, and that curvature ``(N,)``."""
    uu, uv, vv = hessian.T
    mean, half = (uu + vv) / 2.0, (uu - vv) / 2.0
    angle = np.arctan2(uv, half) / 2.0
    return np.stack([-np.sin(angle), np.cos(angle)], axis=-1), mean - np.hypot(half, uv)
