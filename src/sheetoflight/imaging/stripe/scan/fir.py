"""Zero of a Gaussian-derivative filter across the line.

The filter's output at whole pixels falls through zero at the line. Between pixels a cubic through
four outputs gives the zero: the straight line through two is up to 0.02 px off.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.finish import join, keep
from sheetoflight.imaging.stripe.scan.layout import (
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

_SEARCHED = np.uint64(4)  # px on either side of the peak where the filter is evaluated
_SLACK = 0.3  # px that the zero may lie off the rough centre
_NEWTON_STEPS = 2

_DROP, _LEFT, _F0, _F1, _RIGHT = WORK[:5]
_FIRST_OUTPUT = WORK[5]


def reach(smoothing: float) -> int:
    """Taps on either side of the middle; an even number, as they are taken in twos."""
    return 2 * int(np.ceil(1.25 * smoothing))


@cache
def derivative_taps(smoothing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Taps 1 … R of the antisymmetric filter, and its autocorrelation at shifts 0 … 3."""
    side = reach(smoothing)
    k = np.arange(-side, side + 1.0)
    taps = k * np.exp(-0.5 * (k / smoothing) ** 2)
    full = np.correlate(taps, taps, "full")
    return taps[side + 1 :], full[2 * side : 2 * side + 4]


@kernel
def filtered(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    lanes: Index,
    half: Index,
    least_snr: float,
    taps: NDArray,
    correlation: NDArray,
    values: NDArray,
    good: NDArray,
) -> float:
    """Scan a frame; return its noise.

    The standard uncertainty is that of the interpolated output, ``σ √(lᵀ R l)`` with the cubic's
    weights l and the filter's autocorrelation R, over the output's slope.
    """
    noise = noise_std(frame, by_rows, at, np.int64(half))
    window, record = np.empty(window_size(half), frame.dtype), np.empty(RECORD)
    for tile in range(tiles(len(at))):
        if look(frame, by_rows, at, tile, lanes, half, noise * least_snr, window, record):
            first, last = _searched(record)
            for m in range(first, last + ONE):
                slot = _FIRST_OUTPUT + m * LANES
                _filter(window, lanes, half + m - _SEARCHED, taps, slot, record)
            _choose(first, last, record)
            _interpolate(correlation, noise, record)
        keep(record, at, tile, values)
    join(values, good)
    return noise


@kernel
def _searched(record: NDArray) -> tuple[Index, Index]:
    """First and last output that a tile needs: two on either side of every zero."""
    least, greatest = float(_SEARCHED), -float(_SEARCHED)
    for lane in range(LANES):
        if record[LIT + lane] > 0.0:
            least = min(least, record[ROUGH_CENTRE + lane])
            greatest = max(greatest, record[ROUGH_CENTRE + lane])
    middle = float(_SEARCHED)
    first = max(np.floor(least - _SLACK) - 1.0 + middle, 0.0)
    last = min(np.floor(greatest + _SLACK) + 2.0 + middle, 2.0 * middle)
    return np.uint64(first), np.uint64(max(last, first + 3.0))


@kernel
def _filter(
    window: NDArray,
    lanes: Index,
    middle: Index,
    taps: NDArray,
    slot: Index,
    record: NDArray,
) -> None:
    for lane in range(LANES):
        record[slot + lane] = 0.0
    for k in range(np.uint64(0), np.uint64(len(taps)), TWO):
        up, down = (middle - k - ONE) * LANES, (middle + k + ONE) * LANES
        _add_two(window, lanes, up, down, taps[k], taps[k + ONE], slot, record)


@kernel
def _add_two(
    window: NDArray,
    lanes: Index,
    up: Index,
    down: Index,
    tap: float,
    next_tap: float,
    slot: Index,
    record: NDArray,
) -> None:
    """Two pairs of taps. The number of lanes comes as an argument as in `take`."""
    for lane in range(lanes):
        inner = float(window[down + lane]) - float(window[up + lane])
        outer = float(window[down + LANES + lane]) - float(window[up - LANES + lane])
        record[slot + lane] += tap * inner + next_tap * outer


@kernel
def _choose(first: Index, last: Index, record: NDArray) -> None:
    """Of the falls through zero take the greatest, with an output more on either side."""
    for lane in range(LANES):
        record[_DROP + lane] = 0.0
        record[CENTRE + lane] = 0.0
    for m in range(first + ONE, last - ONE):
        here = _FIRST_OUTPUT + m * LANES
        position = float(m) - float(_SEARCHED)
        for lane in range(LANES):
            left, f0 = record[here - LANES + lane], record[here + lane]
            f1, right = record[here + LANES + lane], record[here + TWO * LANES + lane]
            old_drop, old_centre = record[_DROP + lane], record[CENTRE + lane]
            old_left, old_f0 = record[_LEFT + lane], record[_F0 + lane]
            old_f1, old_right = record[_F1 + lane], record[_RIGHT + lane]
            better = (f0 > 0.0) & (f1 <= 0.0) & (f0 - f1 > old_drop)
            record[_DROP + lane] = f0 - f1 if better else old_drop
            record[CENTRE + lane] = position if better else old_centre
            record[_LEFT + lane] = left if better else old_left
            record[_F0 + lane] = f0 if better else old_f0
            record[_F1 + lane] = f1 if better else old_f1
            record[_RIGHT + lane] = right if better else old_right


@kernel
def _interpolate(correlation: NDArray, noise: float, record: NDArray) -> None:
    r0, r1, r2, r3 = correlation[0], correlation[1], correlation[2], correlation[3]
    for lane in range(LANES):
        left, f0 = record[_LEFT + lane], record[_F0 + lane]
        f1, right = record[_F1 + lane], record[_RIGHT + lane]
        first = f1 - left * (1 / 3) - f0 / 2.0 - right * (1 / 6)
        second = (left + f1) / 2.0 - f0
        third = (right - left) * (1 / 6) + (f0 - f1) / 2.0
        drop = record[_DROP + lane]
        x = f0 / drop
        slope = -drop
        for _ in range(_NEWTON_STEPS):
            slope = first + x * (2.0 * second + 3.0 * x * third)
            x -= (f0 + x * (first + x * (second + x * third))) / slope
            x = min(max(x, 0.0), 1.0)
        a = -x * (x - 1.0) * (x - 2.0) * (1 / 6)
        b = (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
        c = -(x + 1.0) * x * (x - 2.0) / 2.0
        d = (x + 1.0) * x * (x - 1.0) * (1 / 6)
        variance = r0 * (a * a + b * b + c * c + d * d)
        variance += 2.0 * (r1 * (a * b + b * c + c * d) + r2 * (a * c + b * d) + r3 * a * d)
        lit = record[LIT + lane]
        record[CENTRE + lane] += x
        record[STD + lane] = noise * np.sqrt(variance) / -slope
        record[WIDTH + lane] = record[ROUGH_WIDTH + lane]
        record[PEAK + lane] = record[HEIGHT + lane]
        record[FOUND + lane] = lit if (drop > 0.0) & (slope < 0.0) else 0.0
