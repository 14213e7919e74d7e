"""Weighted parabola through the logarithms of the samples about the peak.

The logarithm of a Gaussian is a parabola. A sample's logarithm has the standard deviation σ/s, so
it counts with s² (Guo, A simple algorithm for fitting a Gaussian function, IEEE Signal Processing
Magazine 28(5), 2011; there with s of the last fit, which here gains nothing over the sample's
own, as only samples above a part of the peak are used).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.finish import join, keep
from sheetoflight.imaging.stripe.scan.layout import (
    BACKGROUND,
    CENTRE,
    FOUND,
    HEIGHT,
    LANES,
    LIT,
    ONE,
    PEAK,
    RECORD,
    ROUGH_CENTRE,
    ROUGH_WIDTH,
    STD,
    WIDTH,
    WORK,
    Index,
    exponential,
    tiles,
    window_size,
)
from sheetoflight.imaging.stripe.scan.rough import look
from sheetoflight.imaging.stripe.scan.windows import noise_std

_PART = 0.2  # of the peak, down to which samples count
_NARROWEST = 5.0  # curvature of the logarithm: a standard deviation of 0.32 px

_ABOVE, _BELOW = WORK[:2]
_M0, _M1, _M2, _M3, _M4, _Z0, _Z1, _Z2 = WORK[2:10]


@kernel
def parabolas(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    lanes: Index,
    half: Index,
    least_snr: float,
    full: float,
    values: NDArray,
    good: NDArray,
) -> float:
    """Scan a frame; return its noise.

    Samples at the level `full` or above are left out. The standard uncertainty follows from the
    normal matrix of the weights s²/σ² through ``c = −p₁ / 2p₂``.
    """
    noise = noise_std(frame, by_rows, at, np.int64(half))
    window, record = np.empty(window_size(half), frame.dtype), np.empty(RECORD)
    for tile in range(tiles(len(at))):
        if look(frame, by_rows, at, tile, lanes, half, noise * least_snr, window, record):
            _sum(window, lanes, half, full, record)
            _solve(noise, record)
        keep(record, at, tile, values)
    join(values, good)
    return noise


@kernel
def _sum(window: NDArray, lanes: Index, half: Index, full: float, record: NDArray) -> None:
    for index in range(_M0, _Z2 + LANES):
        record[index] = 0.0
    for lane in range(LANES):
        record[_ABOVE + lane] = record[LIT + lane]
        record[_BELOW + lane] = record[LIT + lane]
    _add(window, lanes, half, _BELOW, 0.0, full, record)
    for distance in range(ONE, half + ONE):
        _add(window, lanes, half - distance, _ABOVE, -float(distance), full, record)
        _add(window, lanes, half + distance, _BELOW, float(distance), full, record)
        going = False
        for lane in range(LANES):
            going |= record[_ABOVE + lane] + record[_BELOW + lane] > 0.0
        if not going:
            break


@kernel
def _add(
    window: NDArray,
    lanes: Index,
    index: Index,
    alive: Index,
    x: float,
    full: float,
    record: NDArray,
) -> None:
    """Add one sample of every lane that has had no gap between it and the peak."""
    start = index * LANES
    for lane in range(lanes):
        sample = float(window[start + lane])
        part = (sample - record[BACKGROUND + lane]) / record[HEIGHT + lane]
        on = record[alive + lane]
        on = on if part > _PART else 0.0
        record[alive + lane] = on
        root = np.sqrt(max(part, _PART))
        t = (root - 1.0) / (root + 1.0)
        q = t * t
        # ln(part) = 4 artanh(t)
        log = 4.0 * t * (1.0 + q * (1 / 3 + q * (1 / 5 + q * (1 / 7 + q * (1 / 9 + q * (1 / 11))))))
        weight = 0.0 if sample >= full else on * part * part
        record[_M0 + lane] += weight
        record[_M1 + lane] += weight * x
        record[_M2 + lane] += weight * x * x
        record[_M3 + lane] += weight * x * x * x
        record[_M4 + lane] += weight * x * x * x * x
        record[_Z0 + lane] += weight * log
        record[_Z1 + lane] += weight * x * log
        record[_Z2 + lane] += weight * x * x * log


@kernel
def _solve(noise: float, record: NDArray) -> None:
    for lane in range(LANES):
        m0, m1, m2 = record[_M0 + lane], record[_M1 + lane], record[_M2 + lane]
        z0, height = record[_Z0 + lane], record[HEIGHT + lane]
        a11 = m2 - m1 * m1 / m0
        a12 = record[_M3 + lane] - m1 * m2 / m0
        a22 = record[_M4 + lane] - m2 * m2 / m0
        r1 = record[_Z1 + lane] - m1 * z0 / m0
        r2 = record[_Z2 + lane] - m2 * z0 / m0
        determinant = a11 * a22 - a12 * a12
        p1 = (r1 * a22 - r2 * a12) / determinant
        p2 = (r2 * a11 - r1 * a12) / determinant
        p0 = (z0 - m1 * p1 - m2 * p2) / m0
        centre = -p1 / (2.0 * p2)
        variance = a22 - 4.0 * centre * a12 + 4.0 * centre * centre * a11
        variance /= 4.0 * p2 * p2 * determinant
        moved = abs(centre - record[ROUGH_CENTRE + lane])
        found = (record[LIT + lane] > 0.0) & (p2 < 0.0) & (determinant > 0.0)
        found &= (moved < 1.0 + record[ROUGH_WIDTH + lane]) & (p2 > -_NARROWEST)
        record[CENTRE + lane] = centre
        record[STD + lane] = noise / height * np.sqrt(variance)
        record[WIDTH + lane] = np.sqrt(-0.5 / p2)
        record[PEAK + lane] = height * exponential(p0 + 0.5 * p1 * centre) if found else 0.0
        record[FOUND + lane] = 1.0 if found else 0.0
