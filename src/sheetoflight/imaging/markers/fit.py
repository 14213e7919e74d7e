"""Measuring one marker: least squares of its formula to the grey values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers import outline
from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.grey import GreyPicture
from sheetoflight.imaging.markers.outline import LineLight


@dataclass(frozen=True)
class FitOptions:
    """How a marker is measured.

    Parameters
    ----------
    surround : float
        The fit sees the pixels within this distance of the centre, in radii.
    most_pixels : int
        Larger markers are read at every second, third … pixel.
    steps : int
        Levenberg–Marquardt steps at most.
    robust_at : float
        Residuals beyond this many standard deviations lose their weight (Tukey's biweight
        reaches zero there); they are dirt, dust or another edge.
    least_explained : float
        Share of the grey values' variance that the formula must explain.
    line_error : float
        Standard deviation of the laser line's light from what the formula says, as a share:
        speckle, a profile that is not Gaussian, and ink's edges under it, which the formula
        smooths without regard to the line.
    most_std : float
        Largest standard uncertainty of the marker's place, px; beyond it too little is seen.
    """

    surround: float = 1.2
    most_pixels: int = 6000
    steps: int = 30
    robust_at: float = 6.0
    least_explained: float = 0.8
    line_error: float = 0.25
    most_std: float = 0.3


@dataclass(frozen=True)
class MarkerFit:
    """A marker as measured.

    Parameters
    ----------
    uv : (2,) array
        Crossing of a quadrant marker's edges, or middle of a disc's outline, px.
    covariance : (2, 2) array
        Of `uv`, px².
    shape : Candidate
        The outline about its own middle, and the contrast, as fitted.
    explained : float
        Share of the grey values' variance that the fit explains.
    """

    uv: Array
    covariance: Array
    shape: Candidate
    explained: float


_START_BLUR_SHARE = 0.1
_CONVERGED_PX = 1e-4
_LOST = 1e6
_QUADRANT_ROOM = 40
_SATURATED = 254.5
_LEAST_NOISE_SHARE = 0.5


def fitted_marker(
    picture: GreyPicture,
    candidate: Candidate,
    quadrant: bool,
    line: LineLight | None = None,
    options: FitOptions = FitOptions(),
) -> MarkerFit | None:
    """Measure a candidate, or None where the formula does not describe what is seen.

    Parameters
    ----------
    line : LineLight, optional
        The laser line, where it crosses the marker along the target.
    """
    offsets, grey = _pixels(picture, candidate, options)
    if len(grey) < _QUADRANT_ROOM:
        return None
    start = outline.starting_parameters(
        candidate, quadrant, max(1.0, _START_BLUR_SHARE * candidate.radius), line
    )
    seen = _Seen(offsets, grey, picture.noise, line, options)
    solution = _solved(start, seen)
    if solution is None or not _regular(solution.information):
        return None
    values, weights, residuals = solution.values, solution.weights, solution.residuals
    spread = float(weights @ (grey - np.average(grey, weights=weights)) ** 2)
    misfit = float(weights @ residuals**2)
    explained = 1.0 - misfit / spread
    if explained < options.least_explained:
        return None
    variance = misfit / max(solution.pixels - len(values), 1.0)
    variance = max(variance, (_LEAST_NOISE_SHARE * picture.noise) ** 2)
    centre = outline.CROSSING if quadrant else outline.OUTLINE
    covariance = variance * np.linalg.inv(solution.information)[centre, centre]
    if np.trace(covariance) / 2 > options.most_std**2:
        return None
    contrast, surround = outline.contrast_of(values)
    shape = Candidate(
        candidate.centre + values[outline.OUTLINE], outline.frame_of(values), contrast, surround
    )
    uv = candidate.centre + values[centre]
    return MarkerFit(uv, covariance, shape, explained)


def _pixels(picture: GreyPicture, candidate: Candidate, options: FitOptions) -> tuple[Array, Array]:
    """Offsets from the candidate's centre and grey values of the pixels the fit sees."""
    height, width = picture.values.shape
    reach = options.surround * np.linalg.norm(candidate.frame, ord=2)
    stride = max(1, int(np.ceil(np.sqrt((2 * reach) ** 2 / options.most_pixels))))
    low = np.ceil(candidate.centre - reach).astype(int)
    high = np.floor(candidate.centre + reach).astype(int) + 1
    u = np.arange(max(low[0], 0), min(high[0], width), stride)
    v = np.arange(max(low[1], 0), min(high[1], height), stride)
    if not (len(u) and len(v)):
        return np.empty((0, 2)), np.empty(0)
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    offsets = grid - candidate.centre
    inside = np.linalg.norm(offsets @ np.linalg.inv(candidate.frame).T, axis=1) < options.surround
    grid = grid[inside]
    return offsets[inside], picture.values[grid[:, 1], grid[:, 0]].astype(float)


class _Seen(NamedTuple):
    """The pixels of one marker, and how they are to be judged."""

    offsets: Array
    grey: Array
    noise: float
    line: LineLight | None
    options: FitOptions


@dataclass(frozen=True)
class _State:
    """The formula at some parameters, against the pixels.

    ``weights`` are relative to pixels in plain light; ``pixels`` is how many count after dirt
    and other edges have lost their say.
    """

    values: Array
    residuals: Array
    jacobian: Array
    weights: Array
    pixels: float

    @property
    def information(self) -> Array:
        return (self.jacobian * self.weights[:, None]).T @ self.jacobian


def _state(values: Array, seen: _Seen) -> _State:
    grey, jacobian, line_grey = outline.intensity(values, seen.offsets, seen.line)
    residuals = seen.grey - grey
    # A saturated pixel only says that the light was at least so strong.
    content = (seen.grey >= _SATURATED) & (residuals < 0)
    residuals = np.where(content, 0.0, residuals)
    jacobian[content] = 0.0
    trust = 1.0 / (1.0 + (seen.options.line_error * line_grey / seen.noise) ** 2)
    robust = _robust_weights(residuals * np.sqrt(trust), seen.noise, seen.options.robust_at)
    return _State(values, residuals, jacobian, robust * trust, float(robust[~content].sum()))


def _solved(start: Array, seen: _Seen) -> _State | None:
    """Levenberg–Marquardt with weights from the residuals; None where it does not converge."""
    state = _state(start, seen)
    damping = 1e-3
    for _ in range(seen.options.steps):
        information = state.information
        scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
        normal = information / np.outer(scale, scale) + damping * np.eye(len(start))
        gradient = state.jacobian.T @ (state.weights * state.residuals)
        step = np.linalg.solve(normal, gradient / scale) / scale
        trial = _state(outline.bounded(state.values + step), seen)
        cost = float(state.weights @ state.residuals**2)
        if float(state.weights @ trial.residuals**2) <= cost * (1 + 1e-12):
            state = trial
            damping = max(damping / 10.0, 1e-9)
            if np.abs(step[outline.OUTLINE]).max() < _CONVERGED_PX and damping < 1e-4:
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


def _robust_weights(residuals: Array, noise: float, robust_at: float) -> Array:
    """Tukey's biweight."""
    spread = max(1.4826 * float(np.median(np.abs(residuals))), noise, 1e-6)
    ratio = residuals / (robust_at * spread)
    return np.where(np.abs(ratio) < 1.0, (1.0 - ratio**2) ** 2, 0.0)
