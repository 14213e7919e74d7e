"""Centres of the line as zeros of a derivative filter's answer along rows or columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.rows import Rows, background_operator, wide_rows

_LEAST_SCALE_PX = 1.0
_TAPS_PER_SCALE = 4.0
_NARROW_PX = 1.5  # up to this width along the row the four-tap filter is used
_NODES = np.arange(-1.0, 3.0)  # of the cubic through four answers, from the last positive one
_STEPS = 6
_SLOPE_ROWS = 61
_MOST_OUTSIDE = 0.01


def fir_centres(light: LineLight, track: Track) -> Located:
    """Zero of the answer of a derivative-of-Gaussian filter as wide as the line.

    Where filter and line are equally wide the zero is that of the matched filter, and its noise
    the bound ``1.062 √w σ/A``. The answer's four values about its change of sign are joined by a
    cubic, for a straight line between two of them would move the zero by up to 0.04 px.
    """
    width = float(np.median(track.width / track.cosine))
    scale = max(width, _LEAST_SCALE_PX)
    reach = int(np.ceil(_TAPS_PER_SCALE * scale))
    offset = np.arange(-reach, reach + 1.0)
    return _zeros(light, track, -offset * np.exp(-0.5 * (offset / scale) ** 2), cubic=True)


def blais_rioux_centres(light: LineLight, track: Track) -> Located:
    """Zero of the four- or eight-tap filter of Blais and Rioux, interpolated linearly.

    F. Blais, M. Rioux, "Real-time numerical peak detector", Signal Processing 11(2), 1986:
    ``g(i) = Σ f(i − k) − Σ f(i + k)``, k = 1 … 2 for narrow lines, 1 … 4 for wider ones.
    """
    width = float(np.median(track.width / track.cosine))
    side = np.ones(2 if width <= _NARROW_PX else 4)
    return _zeros(light, track, np.concatenate([side, [0.0], -side]), cubic=False)


def _zeros(light: LineLight, track: Track, taps: Array, cubic: bool) -> Located:
    """Where ``Σ taps_k f(i + k)`` falls through zero nearest to the rough centres."""
    rows, centre, width = wide_rows(light, track)
    rows = _levelled(rows, centre, width)
    answer = _answer(rows, taps)
    left, found = _change_of_sign(answer, centre)
    nodes = np.clip(left[:, None] + _NODES.astype(int), 0, answer.shape[1] - 1)
    values = np.take_along_axis(answer, nodes, axis=1)
    if not cubic:
        values = _straight(values)
    t = _root(values)
    weights, slope = _lagrange(t)
    steepness = np.sum(slope * values, axis=1)
    kernel = _kernel(weights if cubic else _between(t), taps)
    places = left[:, None] - 1.0 + np.arange(kernel.shape[1]) - len(taps) // 2
    law = track.law.variance(
        track.amplitude[:, None] * np.exp(-0.5 * ((places - centre[:, None]) / width[:, None]) ** 2)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        std = np.sqrt(np.sum(kernel**2 * law, axis=1)) / np.abs(steepness) * track.cosine
    good = found & (steepness < 0.0) & (t > -0.05) & (t < 1.05) & np.isfinite(std)
    good &= np.abs(left + t - centre) < 1.5 * width + 1.0
    good &= _inside(rows, places, kernel)
    return Located(track.uv(left + t + rows.first), std, good)


def _levelled(rows: Rows, centre: Array, width: Array) -> Rows:
    """Rows without the slope of their background, which would pull the zero towards the brighter
    side; the slope is that of many rows, so that it brings no noise of its own."""
    operator = background_operator(rows, centre, width)[..., 1]
    slope = np.einsum("nk,nk->n", rows.samples, operator)
    smooth = median_filter(slope, min(_SLOPE_ROWS, len(slope)), mode="nearest")
    return replace(rows, samples=rows.samples - smooth[:, None] * (rows.x - centre[:, None]))


def _answer(rows: Rows, taps: Array) -> Array:
    """The filter's answer ``(N, K)`` at every sample; the picture's border is continued."""
    reach = len(taps) // 2
    padded = np.pad(rows.samples, ((0, 0), (reach, reach)), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, len(taps), axis=1) @ taps * -1.0


def _inside(rows: Rows, places: Array, kernel: Array) -> NDArray[np.bool_]:
    """Whether next to all of what the filter sees ``(N, taps + 3)`` lies inside the picture."""
    size = rows.samples.shape[1]
    index = np.clip(places.astype(np.int64), 0, size - 1)
    outside = (places != index) | (np.take_along_axis(rows.weights, index, axis=1) == 0.0)
    weight = np.abs(kernel)
    return np.sum(weight * outside, axis=1) < _MOST_OUTSIDE * np.sum(weight, axis=1)


def _change_of_sign(answer: Array, centre: Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The sample ``(N,)`` after which the answer falls through zero, and whether there is one."""
    falls = (answer[:, :-1] > 0.0) & (answer[:, 1:] <= 0.0)
    distance = np.abs(np.arange(answer.shape[1] - 1) + 0.5 - centre[:, None])
    distance = np.where(falls, distance, np.inf)
    return np.argmin(distance, axis=1), np.isfinite(distance.min(axis=1))


def _straight(values: Array) -> Array:
    """Four values on the straight line through the middle two."""
    step = values[:, 2] - values[:, 1]
    return values[:, 1:2] + step[:, None] * _NODES


def _between(t: Array) -> Array:
    """Weights ``(N, 4)`` of the straight line between the middle two of four values."""
    return np.stack([np.zeros_like(t), 1.0 - t, t, np.zeros_like(t)], axis=-1)


def _root(values: Array) -> Array:
    """Zero ``(N,)`` of the cubic through values at −1, 0, 1, 2, from the straight line's zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = values[:, 1] / (values[:, 1] - values[:, 2])
        for _ in range(_STEPS):
            weights, slope = _lagrange(t)
            step = np.sum(weights * values, axis=1) / np.sum(slope * values, axis=1)
            t = t - np.clip(step, -0.5, 0.5)
    return np.nan_to_num(t, nan=0.5, posinf=0.5, neginf=0.5)


def _lagrange(t: Array) -> tuple[Array, Array]:
    """Weights ``(N, 4)`` of the cubic at `t` between the nodes −1, 0, 1, 2, and their slopes."""
    t = t[:, None]
    weights = np.concatenate(
        [
            -t * (t - 1.0) * (t - 2.0) / 6.0,
            (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
            -(t + 1.0) * t * (t - 2.0) / 2.0,
            (t + 1.0) * t * (t - 1.0) / 6.0,
        ],
        axis=1,
    )
    slope = np.concatenate(
        [
            -(3.0 * t * t - 6.0 * t + 2.0) / 6.0,
            (3.0 * t * t - 4.0 * t - 1.0) / 2.0,
            -(3.0 * t * t - 2.0 * t - 2.0) / 2.0,
            (3.0 * t * t - 1.0) / 6.0,
        ],
        axis=1,
    )
    return weights, slope


def _kernel(weights: Array, taps: Array) -> Array:
    """What four answers, summed with weights, make of the samples ``(N, taps + 3)``."""
    kernel = np.zeros((len(weights), len(taps) + 3))
    for node in range(4):
        kernel[:, node : node + len(taps)] += weights[:, node : node + 1] * taps
    return kernel
