"""Centroid under a smooth window that moves with the line.

A plain threshold lets whole pixels in and out, and the centroid follows their grid by some 0.05
px where the line is narrow. Here the samples, without their background, are weighed by
``W(d) = (1 − (d/R)²)²`` of their distance d = x − c from the centre, R = 3 widths, and the centre
is where ``F(c) = Σ W(d) d s`` is zero: one Newton step from the rough centre.
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
    TWO,
    WIDTH,
    WORK,
    Index,
    tiles,
    window_size,
)
from sheetoflight.imaging.stripe.scan.rough import look
from sheetoflight.imaging.stripe.scan.windows import noise_std

_RADIUS = 3.0  # of the window, in widths of the line

_CURVATURE, _MOMENT, _SLOPE, _SQUARES = WORK[:4]


@kernel
def centroids(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    lanes: Index,
    half: Index,
    least_snr: float,
    values: NDArray,
    good: NDArray,
) -> float:
    """Scan a frame, with ``std = σ √(Σ W² d²) / |F'(c)|``; return its noise."""
    noise = noise_std(frame, by_rows, at, np.int64(half))
    window, record = np.empty(window_size(half), frame.dtype), np.empty(RECORD)
    for tile in range(tiles(len(at))):
        if look(frame, by_rows, at, tile, lanes, half, noise * least_snr, window, record):
            reach = _start(half, record)
            for k in range(half - reach, half + reach + ONE, TWO):
                _add_two(window, lanes, k * LANES, float(k) - float(half), record)
            _results(noise, record)
        keep(record, at, tile, values)
    join(values, good)
    return noise


@kernel
def _start(half: Index, record: NDArray) -> Index:
    """Clear the sums; the greatest distance of a sample in use from the peak."""
    reach = 2.0
    for lane in range(LANES):
        radius = _RADIUS * record[ROUGH_WIDTH + lane]
        record[_CURVATURE + lane] = 1.0 / (radius * radius)
        record[_MOMENT + lane] = 0.0
        record[_SLOPE + lane] = 0.0
        record[_SQUARES + lane] = 0.0
        if record[LIT + lane] > 0.0:
            reach = max(reach, radius + abs(record[ROUGH_CENTRE + lane]))
    return min(np.uint64(np.ceil(reach)), half - ONE)


@kernel
def _add_two(window: NDArray, lanes: Index, start: Index, x: float, record: NDArray) -> None:
    """Add the sample at x and the next one."""
    for lane in range(lanes):
        curvature, background = record[_CURVATURE + lane], record[BACKGROUND + lane]
        d = x - record[ROUGH_CENTRE + lane]
        e = d + 1.0
        square, other_square = d * d * curvature, e * e * curvature
        rest, other_rest = max(1.0 - square, 0.0), max(1.0 - other_square, 0.0)
        weight, other_weight = rest * rest * d, other_rest * other_rest * e
        light = float(window[start + lane]) - background
        other_light = float(window[start + LANES + lane]) - background
        record[_MOMENT + lane] += weight * light + other_weight * other_light
        slope = (rest - 4.0 * square) * rest * light
        record[_SLOPE + lane] += (
            slope + (other_rest - 4.0 * other_square) * other_rest * other_light
        )
        record[_SQUARES + lane] += weight * weight + other_weight * other_weight


@kernel
def _results(noise: float, record: NDArray) -> None:
    for lane in range(LANES):
        slope, width = record[_SLOPE + lane], record[ROUGH_WIDTH + lane]
        moved = record[_MOMENT + lane] / slope
        lit = record[LIT + lane]
        found = (slope > 0.0) & (abs(moved) < 1.0 + width)
        record[CENTRE + lane] = record[ROUGH_CENTRE + lane] + moved
        record[STD + lane] = noise * np.sqrt(record[_SQUARES + lane]) / slope
        record[WIDTH + lane] = width
        record[PEAK + lane] = record[HEIGHT + lane]
        record[FOUND + lane] = lit if found else 0.0
