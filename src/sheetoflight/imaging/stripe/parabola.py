"""Centres of the line as the vertex of a parabola through the logarithm of its light."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.rows import background_operator, wide_rows

_LEAST_PART = 0.1  # of the height: below it the logarithm is mostly noise
_FEWEST = 3
_TINY = 1e-9
_ODD = np.log(9.0)  # a parabola three times too narrow or too wide is no line


def parabola_centres(light: LineLight, track: Track) -> Located:
    """Weighted parabola through the logarithm of a Gaussian's light, which is one.

    H. Guo, "A simple algorithm for fitting a Gaussian function", IEEE Signal Processing Magazine
    28(5), 2011: a sample's logarithm is as uncertain as noise over light, so it counts by the
    light's square – that of the rough profile, for the samples' own would prefer those that noise
    has raised.
    """
    rows, centre, width = wide_rows(light, track)
    operator = background_operator(rows, centre, width)
    level, slope = np.einsum("nk,nkp->pn", rows.samples, operator)
    x = rows.x - centre[:, None]
    lit = rows.samples - level[:, None] - slope[:, None] * x
    model = track.amplitude[:, None] * np.exp(-0.5 * (x / width[:, None]) ** 2)
    used = (rows.weights > 0) & ~rows.full & (lit > 0.0) & (np.abs(x) < 3.0 * width[:, None] + 1.0)
    used &= model > _LEAST_PART * track.amplitude[:, None]
    weights = np.where(used, model / track.law.std(model), 0.0)
    coefficients, covariance = _parabola(x, np.log(np.where(used, lit, 1.0)), weights)
    _, b, c = coefficients.T
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = -b / (2.0 * c)
        by_coefficient = np.stack([np.zeros_like(c), -1.0 / (2.0 * c), b / (2.0 * c * c)], axis=-1)
        by_light = _by_light(x, model, weights, np.einsum("np,npq->nq", by_coefficient, covariance))
        variance = _variance(x, by_light, operator, track.law.variance(model))
        std = np.sqrt(variance) * track.cosine
    good = (c < 0.0) & (used.sum(axis=1) >= _FEWEST) & np.isfinite(std)
    good &= np.abs(vertex) < 1.5 * width + 1.0
    good &= np.abs(np.log(-2.0 * c * width**2, where=c < 0.0, out=np.full_like(c, np.inf))) < _ODD
    across = centre + np.where(good, vertex, 0.0) + rows.first
    return Located(track.uv(across), np.where(good, std, np.nan), good)


def _parabola(x: Array, y: Array, weights: Array) -> tuple[Array, Array]:
    """Coefficients ``(N, 3)`` of weighted parabolas and their covariances ``(N, 3, 3)``."""
    jacobian = np.stack([weights, weights * x, weights * x * x], axis=-1)
    normal = np.swapaxes(jacobian, 1, 2) @ jacobian
    diagonal = np.einsum("nii->ni", normal)
    regular = normal + (1e-12 * diagonal + 1e-12)[:, :, None] * np.eye(3)
    right = np.einsum("nkp,nk->np", jacobian, weights * y)
    covariance = np.linalg.inv(regular)
    return np.einsum("npq,nq->np", covariance, right), covariance


def _by_light(x: Array, model: Array, weights: Array, by_normal: Array) -> Array:
    """How the vertex moves with the light of each sample ``(N, K)``, px per grey level."""
    b0, b1, b2 = by_normal.T[..., None]
    return (b0 + b1 * x + b2 * x * x) * weights**2 / np.maximum(model, _TINY)


def _variance(x: Array, by_light: Array, operator: Array, noise: Array) -> Array:
    """Variance of the vertex ``(N,)``: the background's noise moves all logarithms together, and
    where the picture's border cuts one side off, that is most of it."""
    level = np.sum(by_light, axis=1, keepdims=True)
    slope = np.sum(by_light * x, axis=1, keepdims=True)
    by_sample = by_light - operator[..., 0] * level - operator[..., 1] * slope
    return np.sum(by_sample**2 * noise, axis=1)
