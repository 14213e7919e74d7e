"""Centres of the line as the centre of gravity of its light in a window."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.rows import background_operator, wide_rows

_HALF_WIDTH = 2.5  # of the window, in standard deviations of the profile
_LEAST_HALF_PX = 1.5
_STEPS = 12
_CONVERGED_PX = 1e-3


def centroid_centres(light: LineLight, track: Track) -> Located:
    """The centre of gravity in a window of ± 2.5 widths that moves until it is centred on it.

    A straight background, read on both sides, is taken away first. Pixels at the window's borders
    count by the part of them that lies inside, so that the centre does not jump with the phase.
    The window must follow the centre: with a fixed one the tails that it cuts off unequally pull
    the centre back. Nothing is assumed of the profile but that it is symmetric.
    """
    rows, centre, width = wide_rows(light, track)
    half = np.maximum(_HALF_WIDTH * width, _LEAST_HALF_PX)[:, None]
    lit = _without_background(
        rows.samples, background_operator(rows, centre, width), rows.x, centre
    )
    start, still = centre, np.zeros(len(centre), dtype=bool)
    for _ in range(_STEPS):
        share, place = _window(rows.x, centre[:, None], half)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.sum(share * lit * place, axis=1) / np.sum(share * lit, axis=1)
        still = np.abs(found - centre) < _CONVERGED_PX
        centre = np.where(np.abs(found - start) < 1.5 * width + 1.0, found, centre)
        if still.all():
            break
    operator = background_operator(rows, centre, width)
    kernel = _kernel(rows.x, centre, half, lit, operator)
    light_there = track.amplitude[:, None] * np.exp(
        -0.5 * ((rows.x - centre[:, None]) / width[:, None]) ** 2
    )
    std = np.sqrt(np.sum(kernel**2 * track.law.variance(light_there), axis=1)) * track.cosine
    share, _ = _window(rows.x, centre[:, None], half)
    whole = ~((share > 0.0) & (rows.weights == 0.0)).any(axis=1)  # inside the picture
    good = still & whole & np.isfinite(std)
    return Located(track.uv(centre + rows.first), std, good)


def _without_background(samples: Array, operator: Array, x: Array, centre: Array) -> Array:
    level, slope = np.einsum("nk,nkp->pn", samples, operator)
    return samples - level[:, None] - slope[:, None] * (x - centre[:, None])


def _window(x: Array, centre: Array, half: Array) -> tuple[Array, Array]:
    """Part of each pixel ``(N, K)`` inside the window, and the middle of that part."""
    low = np.maximum(x - 0.5, centre - half)
    high = np.minimum(x + 0.5, centre + half)
    return np.maximum(high - low, 0.0), (low + high) / 2.0


def _kernel(x: Array, centre: Array, half: Array, lit: Array, operator: Array) -> Array:
    """How the centre moves with each sample ``(N, K)``, px per grey level."""
    share, place = _window(x, centre[:, None], half)
    lever = share * (place - centre[:, None])
    total = np.sum(share * lit, axis=1)
    # Light at the window's borders follows the window, so the centre moves further.
    index = np.clip(np.rint(centre[:, None] + half * [-1.0, 1.0]).astype(int), 0, len(x) - 1)
    border = np.take_along_axis(lit, index, axis=1).sum(axis=1)
    gain = 1.0 / np.maximum(1.0 - half[:, 0] * border / total, 0.2)
    level = np.sum(lever, axis=1)
    slope = np.sum(lever * (x - centre[:, None]), axis=1)
    by_sample = lever - operator[..., 0] * level[:, None] - operator[..., 1] * slope[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return by_sample * (gain / total)[:, None]
