"""What a detector's centre errs with the line's place between the pixels, whatever the noise.

A window's borders, a filter's straight lines between samples, and above all whole pixels make the
centre depend on the phase. How much, each detector shows on lines that are known exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.noise import NoiseLaw

_ROWS, _PERIOD_ROWS = 160, 32
_AMPLITUDE = 1e4
_STEPS_PER_WIDTH = 20
_STEPS_PER_SLOPE = 10


def phase_std(detector: Callable[[LineLight, Track], Located], track: Track) -> Array:
    """Root mean square error ``(N,)`` over all phases, across the line, px."""
    width = track.width / track.cosine
    steps = np.maximum(np.rint(width * _STEPS_PER_WIDTH), _STEPS_PER_WIDTH // 4).astype(int)
    slopes = np.rint(np.minimum(track.slope, 1.0) * _STEPS_PER_SLOPE).astype(int)
    cases = list(zip(steps.tolist(), slopes.tolist(), strict=True))
    known = {
        case: _error(detector, case[0] / _STEPS_PER_WIDTH, case[1] / _STEPS_PER_SLOPE)
        for case in set(cases)
    }
    return np.array([known[case] for case in cases]) * track.cosine


@lru_cache(maxsize=512)
def _error(detector: Callable[[LineLight, Track], Located], width: float, slope: float) -> float:
    """Error along the rows on a noise-free line of standard deviation `width` px along them, which
    moves by `slope` px from row to row and by one more in 32 of them."""
    reach = int(np.ceil(8.0 * width)) + 8
    centres = reach + np.arange(_ROWS) * (slope + 1.0 / _PERIOD_ROWS)
    x = np.arange(2 * reach + int(centres[-1] - reach) + 1)
    right, left = (x + 0.5 - centres[:, None]) / width, (x - 0.5 - centres[:, None]) / width
    light = LineLight(
        picture=(_AMPLITUDE * width * np.sqrt(2.0 * np.pi) * (ndtr(right) - ndtr(left))).astype(
            np.float32
        ),
        full=np.zeros((_ROWS, len(x)), dtype=bool),
        noise_std=1.0,
        least_std=1e-3,
        differenced=True,
    )
    track = Track(
        along=np.arange(_ROWS),
        across=centres,
        by_rows=True,
        slope=np.full(_ROWS, slope),
        width=np.full(_ROWS, width / np.sqrt(1.0 + slope**2)),
        amplitude=np.full(_ROWS, _AMPLITUDE),
        law=NoiseLaw(1.0, 0.0),
    )
    found = detector(light, track)
    inner = slice(_PERIOD_ROWS, -_PERIOD_ROWS)  # away from the picture's upper and lower border
    error = (found.uv[inner, 0] - centres[inner])[found.good[inner]]
    return float(np.sqrt(np.mean(error**2))) if len(error) else 0.0
