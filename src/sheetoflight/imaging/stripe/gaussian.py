"""Centres of the line by least squares: a Gaussian, integrated over each pixel.

Every row (or column, where the line runs more along the rows) that the line crosses gives one
centre, from the picture's own samples: nothing is interpolated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres, Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.noise import NoiseLaw, noise_law, redundancies
from sheetoflight.imaging.stripe.pooling import Prior, no_prior, pooled
from sheetoflight.imaging.stripe.rows import Rows, rows_about

_HALF_WIDTH = 4.0  # of the samples taken across the line, in standard deviations
_SAMPLES = (3, 40)  # fewest and most samples on either side
_STEPS = 20
_CONVERGED_PX = 1e-3
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-4
# Of what the linear model promised; where less is kept, the step went too far.
_POOR_GAIN, _FULL_GAIN = 0.25, 0.75
_WIDTHS = (0.3, 14.0)  # standard deviations that count as a line, px


def gaussian_centres(light: LineLight, track: Track) -> Located:
    """Centres of `fitted_centres`."""
    fit = fitted_centres(light, track)
    return Located(fit.uv, fit.std, fit.good)


def fitted_centres(light: LineLight, track: Track) -> Centres:
    """Fit amplitude, centre, width and background in every row of the track.

    The model is ``b + A w √(2π) [Φ((x + ½ − c)/w) − Φ((x − ½ − c)/w)]``, plus a slope of the
    background where no off-picture has removed it. The box of the pixel along the track
    is symmetric about the centre, so it widens the profile and does not move it.

    Parameters
    ----------
    light : LineLight
    track : Track
    """
    cosine = track.cosine
    reach = float(np.median(track.width / cosine))
    half = int(np.clip(np.ceil(_HALF_WIDTH * reach + 1.0), *_SAMPLES))
    rows = rows_about(light, track, half)
    start = _start(rows.samples, track.across - rows.first, reach)
    free = 4 if light.differenced else 5
    unknown = no_prior(len(start))
    fit, _, _ = _least_squares(rows, start, unknown, free)
    law, std = _noise(rows, fit, free, light.least_std)
    rows = replace(rows, weights=rows.weights / std)
    fit, covariance, still = _least_squares(rows, fit, unknown, free)
    prior = pooled(fit, covariance, still)
    fit, covariance, still = _least_squares(rows, _towards(fit, prior, free), prior, free)
    across = fit[:, 1] + rows.first
    moved = np.abs(across - track.across)
    good = still & (fit[:, 0] > 0) & (moved < 1.5 * reach + 1.0)
    good &= (fit[:, 2] > _WIDTHS[0]) & (fit[:, 2] * cosine < _WIDTHS[1])
    return Centres(
        uv=track.uv(across),
        std=np.sqrt(covariance[:, 1, 1]) * cosine,
        width=fit[:, 2] * cosine,
        amplitude=fit[:, 0],
        amplitude_std=np.sqrt(covariance[:, 0, 0]),
        dark_variance=np.full(len(across), law.dark_variance),
        variance_per_level=np.full(len(across), law.variance_per_level),
        by_rows=np.full(len(across), track.by_rows),
        good=good,
    )


def _start(samples: Array, centre: Array, width: float) -> Array:
    """Rough amplitude, centre, width, background level and slope ``(N, 5)``."""
    background = np.quantile(samples, 0.25, axis=1)
    index = np.clip(np.rint(centre).astype(int), 1, samples.shape[1] - 2)
    rows = np.arange(len(samples))
    peak = np.maximum(
        samples[rows, index], (samples[rows, index - 1] + samples[rows, index + 1]) / 2
    )
    zero = np.zeros(len(samples))
    start = [peak - background, centre, np.full(len(samples), width), background, zero]
    return np.stack(start, axis=-1)


def _towards(fit: Array, prior: Prior, free: int) -> Array:
    """Parameters from which to fit anew: width and slope as expected, the light's sum as found.

    A row that noise has taken for a spike does not find the way back by itself.
    """
    start = fit.copy()
    known = np.zeros(start.shape, dtype=bool)
    known[:, :free] = prior.information[:, :free] > 0.0
    start[known] = prior.mean[known]
    start[:, 0] *= fit[:, 2] / start[:, 2]
    return start


def _model(parameters: Array, x: Array) -> tuple[Array, Array]:
    """Samples ``(N, K)`` of the model and their derivatives ``(N, K, 5)``."""
    amplitude, centre, width, level, slope = (p[:, None] for p in parameters.T)
    right, left = (x + 0.5 - centre) / width, (x - 0.5 - centre) / width
    g_right, g_left = np.exp(-0.5 * right**2), np.exp(-0.5 * left**2)
    unit = width * np.sqrt(np.pi / 2.0) * (erf(right / np.sqrt(2.0)) - erf(left / np.sqrt(2.0)))
    by_centre = amplitude * (g_left - g_right)
    by_width = amplitude * (unit / width + g_left * left - g_right * right)
    ones = np.ones_like(unit)
    offset = x - centre
    derivatives = np.stack([unit, by_centre - slope, by_width, ones, offset * ones], axis=-1)
    return amplitude * unit + level + slope * offset, derivatives


def _least_squares(
    rows: Rows, start: Array, prior: Prior, free: int
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Levenberg–Marquardt on all rows at once.

    The damping follows how much of the promised descent a step keeps: in noise the bare
    Gauss–Newton step lands as far on the other side of the minimum, again and again.

    Returns
    -------
    parameters : (N, 5), covariance : (N, P, P), still : (N,) bool
        Whether the last step was short.
    """
    parameters, damping = start.copy(), np.full(len(start), _FIRST_DAMPING)
    cost, normal, gradient = _normal_equations(parameters, rows, prior, free)
    still = np.zeros(len(start), dtype=bool)
    for _ in range(_STEPS):
        diagonal = np.einsum("nii->ni", normal)
        damped = normal + (damping[:, None] * diagonal + 1e-12)[:, :, None] * np.eye(free)
        step = np.linalg.solve(damped, gradient[..., None])[..., 0]
        trial = parameters.copy()
        trial[:, :free] += step
        trial[:, 2] = np.clip(trial[:, 2], 0.2, 2.0 * len(rows.x))
        trial[:, 1] = np.clip(trial[:, 1], 0.0, len(rows.x) - 1.0)
        found = _normal_equations(trial, rows, prior, free)
        promised = np.sum(step * (gradient + damping[:, None] * diagonal * step), axis=1)
        gain = (cost - found[0]) / np.maximum(promised, 1e-30)
        better = found[0] <= cost
        still = np.abs(step[:, 1]) < _CONVERGED_PX
        parameters[better], cost[better] = trial[better], found[0][better]
        normal[better], gradient[better] = found[1][better], found[2][better]
        damping *= np.where(gain > _FULL_GAIN, 0.1, np.where(gain > _POOR_GAIN, 1.0, 10.0))
        damping = np.maximum(damping, _LEAST_DAMPING)
        if still.all():
            break
    diagonal = np.einsum("nii->ni", normal)
    regular = normal + (1e-12 * diagonal + 1e-12)[:, :, None] * np.eye(free)
    return parameters, np.linalg.inv(regular), still


def _normal_equations(
    parameters: Array, rows: Rows, prior: Prior, free: int
) -> tuple[Array, Array, Array]:
    """Sums of squares ``(N,)``, normal matrices ``(N, P, P)`` and downhill gradients ``(N, P)``."""
    model, derivatives = _model(parameters, rows.x)
    # A full sample says only that the light was at least as bright.
    weights = rows.weights * ~(rows.full & (model > rows.samples))
    residuals = weights * (rows.samples - model)
    jacobian = weights[..., None] * derivatives[..., :free]
    normal = np.swapaxes(jacobian, 1, 2) @ jacobian
    gradient = np.einsum("nkp,nk->np", jacobian, residuals)
    surprise = prior.mean[:, :free] - parameters[:, :free]
    np.einsum("nii->ni", normal)[...] += prior.information[:, :free]
    gradient += prior.information[:, :free] * surprise
    cost = np.sum(residuals**2, axis=1) + np.sum(prior.information[:, :free] * surprise**2, axis=1)
    return cost, normal, gradient


def _noise(rows: Rows, fit: Array, free: int, least_std: float) -> tuple[NoiseLaw, Array]:
    """The noise law that the fits show, and each sample's standard deviation ``(N, K)`` by it."""
    model, derivatives = _model(fit, rows.x)
    light = fit[:, :1] * derivatives[..., 0]
    used = (rows.weights > 0) & ~(rows.full & (model > rows.samples))
    jacobian = used[..., None] * derivatives[..., :free]
    redundancy = redundancies(jacobian, np.swapaxes(jacobian, 1, 2) @ jacobian)
    law = noise_law((rows.samples - model)[used], light[used], redundancy[used], least_std)
    return law, law.std(light)
