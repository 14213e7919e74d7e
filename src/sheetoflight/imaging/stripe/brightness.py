"""What the background's brightness leaves in the difference of two pictures."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.ridges import Ridges, ridge_answer

_LEVELS = 16
_FEWEST_SAMPLES = 100

# A quantile so low that lines on most of an object do not count as its noise, and the standard
# deviations of normal noise at which the sizes reach it.
_CALM, _CALM_TO_STD = 0.4, 1.0 / 0.5244
_LEAST_OVER_NOISE = 4.0


def least_by_brightness(light: LineLight, found: Ridges) -> Array:
    """Strength ``(N,)`` that a line must have at ridge pixels, by the background's brightness.

    Photon noise, a lamp's flicker and compression grow with the light, so a bright part of the
    scene leaves more in the difference than its dark surroundings. Zero where nothing is known of
    the background.

    Parameters
    ----------
    light : LineLight
    found : Ridges
    """
    if light.background is None or len(found) == 0:
        return np.zeros(len(found))
    answer = np.abs(ridge_answer(light.picture, found.scale)[::2, ::2])
    level = light.background[::2, ::2]
    edges = np.linspace(level.min(), level.max(), _LEVELS + 1)
    member = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, _LEVELS - 1)
    centres, noise = [], []
    for k in range(_LEVELS):
        samples = answer[member == k]
        if samples.size >= _FEWEST_SAMPLES:
            centres.append((edges[k] + edges[k + 1]) / 2.0)
            noise.append(float(np.quantile(samples, _CALM)) * _CALM_TO_STD)
    if not noise:
        return np.zeros(len(found))
    columns, rows = found.pixels.T
    return _LEAST_OVER_NOISE * np.interp(light.background[rows, columns], centres, noise)
