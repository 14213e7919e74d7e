"""Measuring the line on the strip: least squares of a straight stripe of light.

The stripe crosses the target at ``a0`` (where n = 0) at an angle φ from the right angle, its
profile is Gaussian, and its light may fade along it::

    I(a, n) = A (1 + A' s) exp(−t²/2w²) + b + ba (a − a0) + bn n
    t = (a − a0) cos φ − n sin φ,   s = (a − a0) sin φ + n cos φ

Every pixel of plain paper near the line counts by itself: nothing is interpolated, and ink or
edges on one side of the line need not be told from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.crossing.search import RoughLine
from sheetoflight.imaging.stripe.noise import NoiseLaw, noise_law

PLACE, TILT, WIDTH, AMPLITUDE = 0, 1, 2, 3
_STEPS = 40
_CONVERGED_PX = 1e-4
_LOST = 1e8
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-9
_NARROWEST_PX, _WIDEST_PX = 0.2, 60.0
_ROBUST_AT = 5.0
_CORE = 2.0  # widths
_PIECE_PX = 2.0
_FEWEST_PIECES = 5


@dataclass(frozen=True)
class Pixels:
    """Pixels of plain paper near the line, ``(N,)`` each.

    Parameters
    ----------
    a, n : (N,) array
        Coordinates along and across the target, px.
    light : (N,) array
        Grey levels.
    full : (N,) bool array
        Whether the sensor was full: the light there was at least what it shows.
    """

    a: Array
    n: Array
    light: Array
    full: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.a)


@dataclass(frozen=True)
class StraightLine:
    """The line on the strip, as measured.

    Parameters
    ----------
    values : (8,) array
        a0, φ, w, A, A', b, ba, bn.
    covariance : (2, 2) array
        Of a0 (px) and φ (rad). The scatter of the line's pieces about it is in it.
    amplitude_std : float
        Standard uncertainty of A.
    lit, rejected : float
        Length of the line on plain paper, px, and the share of its core that does not fit.
    """

    values: Array
    covariance: Array
    amplitude_std: float
    lit: float
    rejected: float

    @property
    def rough(self) -> RoughLine:
        """The same line as the search gives it."""
        place, tilt, width, amplitude = (float(value) for value in self.values[:4])
        return RoughLine(place, tilt, width, amplitude, amplitude / self.amplitude_std)


@dataclass(frozen=True)
class _State:
    values: Array
    residuals: Array
    jacobian: Array
    weights: Array

    @property
    def cost(self) -> float:
        return float(self.weights @ self.residuals**2)

    @property
    def information(self) -> Array:
        return (self.jacobian * self.weights[:, None]).T @ self.jacobian


def fitted_line_of_light(
    pixels: Pixels, start: RoughLine, noise: float, least_std: float
) -> StraightLine | None:
    """Measure the line, or None where the fit does not settle.

    Parameters
    ----------
    pixels : Pixels
    start : RoughLine
    noise : float
        Standard deviation of the picture's noise, grey levels.
    least_std : float
        What rounding to whole grey levels alone gives.
    """
    values = np.array([start.place, start.tilt, start.width, start.amplitude, 0.0, 0.0, 0.0, 0.0])
    values[5] = float(np.quantile(pixels.light, 0.25))
    values[AMPLITUDE] = max(float(pixels.light.max()) - values[5], 1e-6)
    law = NoiseLaw(noise**2, 0.0)
    state = None
    for _ in range(3):
        state = _solved(values, pixels, law)
        if state is None or not _regular(state.information):
            return None
        values = state.values
        law = _law(state, pixels, least_std)
    assert state is not None
    return _measured(state, pixels, law)


def _law(state: _State, pixels: Pixels, least_std: float) -> NoiseLaw:
    """How the noise grows with the laser's light, from the residuals that fit."""
    used = (state.weights > 0) & state.jacobian.any(axis=1)
    free = state.jacobian.shape[1]
    redundancy = np.full(int(used.sum()), max(1.0 - free / max(int(used.sum()), 1), 0.1))
    light = _light(state.values, pixels)[used]
    return noise_law(state.residuals[used], light, redundancy, least_std)


def _light(values: Array, pixels: Pixels) -> Array:
    """The laser's light that the formula gives, grey levels."""
    place, tilt, width, amplitude, fading = values[:5]
    t = (pixels.a - place) * np.cos(tilt) - pixels.n * np.sin(tilt)
    s = (pixels.a - place) * np.sin(tilt) + pixels.n * np.cos(tilt)
    return amplitude * (1 + fading * s) * np.exp(-0.5 * (t / width) ** 2)


def _state(values: Array, pixels: Pixels, law: NoiseLaw) -> _State:
    place, tilt, width, amplitude, fading, level, by_a, by_n = values
    cos, sin = np.cos(tilt), np.sin(tilt)
    away = pixels.a - place
    t, s = away * cos - pixels.n * sin, away * sin + pixels.n * cos
    bell = np.exp(-0.5 * (t / width) ** 2)
    height = amplitude * (1 + fading * s)
    by_t, by_s = -height * bell * t / width**2, amplitude * fading * bell
    columns = [
        -cos * by_t - sin * by_s - by_a,
        -s * by_t + t * by_s,
        height * bell * t**2 / width**3,
        (1 + fading * s) * bell,
        amplitude * s * bell,
        np.ones_like(bell),
        away,
        pixels.n,
    ]
    jacobian = np.stack(columns, axis=-1)
    residuals = pixels.light - (height * bell + level + by_a * away + by_n * pixels.n)
    content = pixels.full & (residuals < 0)
    residuals = np.where(content, 0.0, residuals)
    jacobian[content] = 0.0
    std = law.std(height * bell)
    ratio = residuals / std
    spread = max(1.4826 * float(np.median(np.abs(ratio))), 1.0)
    ratio = ratio / (_ROBUST_AT * spread)
    robust = np.where(np.abs(ratio) < 1.0, (1.0 - ratio**2) ** 2, 0.0)
    return _State(values, residuals, jacobian, robust / std**2)


def _solved(start: Array, pixels: Pixels, law: NoiseLaw) -> _State | None:
    """Levenberg–Marquardt with weights from the residuals; None where it does not settle."""
    state, damping = _state(start, pixels, law), _FIRST_DAMPING
    for _ in range(_STEPS):
        information = state.information
        scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
        normal = information / np.outer(scale, scale) + damping * np.eye(len(start))
        gradient = state.jacobian.T @ (state.weights * state.residuals)
        step = np.linalg.solve(normal, gradient / scale) / scale
        trial = state.values + step
        trial[WIDTH] = np.clip(trial[WIDTH], _NARROWEST_PX, _WIDEST_PX)
        tried = _state(trial, pixels, law)
        if float(state.weights @ tried.residuals**2) <= state.cost * (1 + 1e-12):
            state = tried
            damping = max(damping / 10.0, _LEAST_DAMPING)
            if abs(step[PLACE]) < _CONVERGED_PX and damping < 1e-4:
                return state
        else:
            damping *= 10.0
            if damping > _LOST:
                return None
    return None


def _regular(information: Array) -> bool:
    scale = np.sqrt(np.diag(information))
    if not np.isfinite(scale).all() or (scale <= 0).any():
        return False
    return bool(np.linalg.cond(information / np.outer(scale, scale)) < 1e12)


def _measured(state: _State, pixels: Pixels, law: NoiseLaw) -> StraightLine:
    values, weights = state.values, state.weights
    std = law.std(_light(values, pixels))
    covariance = np.linalg.inv(state.information)
    place, tilt, width = values[:3]
    t = (pixels.a - place) * np.cos(tilt) - pixels.n * np.sin(tilt)
    s = (pixels.a - place) * np.sin(tilt) + pixels.n * np.cos(tilt)
    core = np.abs(t) < _CORE * width
    trusted = weights * std**2 > 0.1
    lit = np.unique(np.floor(s[core & trusted])).size
    rejected = 1.0 - float(trusted[core].mean()) if core.any() else 1.0
    scatter = _scatter(state, np.floor(s / _PIECE_PX))
    return StraightLine(
        values, scatter * covariance[:2, :2], float(np.sqrt(covariance[3, 3])), float(lit), rejected
    )


def _scatter(state: _State, piece: Array) -> float:
    """Squared scatter of the line's pieces about it over what the noise explains, at least 1.

    Each piece of the line would be moved along the target by its own residuals; speckle, whose
    grains span several pixels, moves neighbouring pixels alike and shows here.
    """
    slope = state.jacobian[:, PLACE] * state.weights
    _, index = np.unique(piece, return_inverse=True)
    information = np.bincount(index, slope * state.jacobian[:, PLACE])
    moved = np.bincount(index, slope * state.residuals)
    told = information > 0.05 * information.max()
    if told.sum() < _FEWEST_PIECES:
        return 1.0
    return max(1.0, float(np.sum(moved[told] ** 2 / information[told])) / (told.sum() - 2))
