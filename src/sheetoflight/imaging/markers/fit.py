"""Measuring one marker: least squares of its formula to the grey values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers import outline
from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.grey import GreyPicture
from sheetoflight.imaging.markers.laser_band import LaserBand


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
    most_std : float
        Largest standard uncertainty of the marker's place, px; beyond it too little is seen.
    """

    surround: float = 1.2
    most_pixels: int = 6000
    steps: int = 30
    robust_at: float = 6.0
    least_explained: float = 0.8
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
    blur : float
        Standard deviation of the edges' smoothing, px.
    explained : float
        Share of the grey values' variance that the fit explains.
    """

    uv: Array
    covariance: Array
    shape: Candidate
    blur: float
    explained: float


_START_BLUR_SHARE = 0.1
_CONVERGED_PX = 1e-4
_QUADRANT_ROOM = 40


def fitted_marker(
    picture: GreyPicture,
    candidate: Candidate,
    quadrant: bool,
    band: LaserBand | None = None,
    options: FitOptions = FitOptions(),
) -> MarkerFit | None:
    """Measure a candidate, or None where the formula does not describe what is seen.

    Parameters
    ----------
    band : LaserBand, optional
        Where the laser line runs along the target; its pixels have no say.
    """
    offsets, grey = _pixels(picture, candidate, options)
    if band is not None:
        clear = ~band.covers(offsets + candidate.centre)
        offsets, grey = offsets[clear], grey[clear]
    if len(grey) < _QUADRANT_ROOM:
        return None
    start = outline.starting_parameters(
        candidate, quadrant, max(1.0, _START_BLUR_SHARE * candidate.radius)
    )
    solution = _solved(start, offsets, grey, picture.noise, options)
    if solution is None:
        return None
    values, weights, residuals, information = solution
    explained = 1.0 - float(weights @ residuals**2 / (weights @ (grey - grey.mean()) ** 2))
    if explained < options.least_explained:
        return None
    variance = float(weights @ residuals**2) / max(float(weights.sum()) - len(values), 1.0)
    variance = max(variance, picture.noise**2 * 0.25)
    centre = outline.CROSSING if quadrant else outline.OUTLINE
    covariance = variance * np.linalg.inv(information)[centre, centre]
    if np.trace(covariance) / 2 > options.most_std**2:
        return None
    contrast, surround = outline.contrast_of(values)
    shape = Candidate(
        candidate.centre + values[outline.OUTLINE], outline.frame_of(values), contrast, surround
    )
    uv = candidate.centre + values[centre]
    return MarkerFit(uv, covariance, shape, outline.blur_of(values), explained)


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


def _solved(
    values: Array, offsets: Array, grey: Array, noise: float, options: FitOptions
) -> tuple[Array, Array, Array, Array] | None:
    """Levenberg–Marquardt with weights from the residuals.

    Returns the parameters, weights, residuals and the information matrix ``JᵀWJ``; None
    where it does not converge.
    """
    damping = 1e-3
    model, jacobian = outline.intensity(values, offsets)
    residuals = grey - model
    weights = _weights(residuals, noise, options.robust_at)
    for _ in range(options.steps):
        weighted = jacobian * weights[:, None]
        information = weighted.T @ jacobian
        scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
        normal = information / np.outer(scale, scale) + damping * np.eye(len(values))
        step = np.linalg.solve(normal, (weighted.T @ residuals) / scale) / scale
        trial = values + step
        trial_model, trial_jacobian = outline.intensity(trial, offsets)
        trial_residuals = grey - trial_model
        if not weights @ trial_residuals**2 <= weights @ residuals**2 * (1 + 1e-12):
            damping *= 10.0
            if damping > 1e6:
                return None
            continue
        values, residuals, jacobian = trial, trial_residuals, trial_jacobian
        damping = max(damping / 10.0, 1e-9)
        weights = _weights(residuals, noise, options.robust_at)
        if np.abs(step[outline.OUTLINE]).max() < _CONVERGED_PX and damping < 1e-4:
            information = (jacobian * weights[:, None]).T @ jacobian
            return (values, weights, residuals, information) if _regular(information) else None
    return None


def _regular(information: Array) -> bool:
    scale = np.sqrt(np.diag(information))
    if not np.isfinite(scale).all() or (scale <= 0).any():
        return False
    return bool(np.linalg.cond(information / np.outer(scale, scale)) < 1e12)


def _weights(residuals: Array, noise: float, robust_at: float) -> Array:
    spread = max(1.4826 * float(np.median(np.abs(residuals))), noise, 1e-6)
    ratio = residuals / (robust_at * spread)
    return np.where(np.abs(ratio) < 1.0, (1.0 - ratio**2) ** 2, 0.0)
