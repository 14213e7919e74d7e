"""From the windows: the background, whether there may be a line, and where and how wide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.layout import (
    BACKGROUND,
    FIRST,
    HEIGHT,
    LANES,
    LAST,
    LIT,
    RECORD,
    ROUGH_CENTRE,
    ROUGH_WIDTH,
    WORK,
)

EDGE = np.uint64(4)  # samples at either end of the window that show the background
_LEAST_FLANKS = 0.25  # light in the peak's two neighbours, as a part of the peak
_PART = 0.4  # of the peak, down to which samples count
_AREA = 2.065  # of a Gaussian of unit height and width above that part

(_ABOVE, _BELOW, _AREA_SUM, _SOFT, _MOMENT) = (WORK + np.uint64(slot) * LANES for slot in range(5))
_ONE, _TWO = np.uint64(1), np.uint64(2)


@kernel
def look(
    windows: NDArray, lanes: np.uint64, half: np.uint64, noise: float, least_snr: float, records: NDArray
) -> int:
    """Fill BACKGROUND, HEIGHT, ROUGH_CENTRE, ROUGH_WIDTH and LIT of all tiles.

    A column may hold a line where its peak rises over the background by `least_snr` times the
    noise, and its two neighbours hold light too.

    Returns
    -------
    int
        Columns that may hold a line.
    """
    size = (_TWO * half + _ONE) * LANES
    lit = 0
    for tile in range(np.uint64(len(records)) // RECORD):
        window = windows[tile * size : (tile + _ONE) * size]
        record = records[tile * RECORD : (tile + _ONE) * RECORD]
        _background(window, lanes, half, record)
        lit += _lit(window, lanes, half, noise * least_snr, record)
        _profile(window, lanes, half, record)
    return lit


@kernel
def _background(window: NDArray, lanes: np.uint64, half: np.uint64, record: NDArray) -> None:
    """Mean of the samples at the window's ends; of one end where the other is cut off."""
    last = _TWO * half
    for lane in range(lanes):
        low = 0.0
        high = 0.0
        for k in range(EDGE):
            low += window[k * LANES + lane]
            high += window[(last - k) * LANES + lane]
        cut_low = record[FIRST + lane] > 0.0
        cut_high = record[LAST + lane] < last
        low = high if cut_low and not cut_high else low
        high = low if cut_high and not cut_low else high
        record[BACKGROUND + lane] = (low + high) / (2.0 * EDGE)


@kernel
def _lit(window: NDArray, lanes: np.uint64, half: np.uint64, least: float, record: NDArray) -> int:
    for lane in range(lanes):
        background = record[BACKGROUND + lane]
        lit = record[LIT + lane]
        height = window[half * LANES + lane] - background
        flanks = window[(half - _ONE) * LANES + lane] + window[(half + _ONE) * LANES + lane]
        flanks -= 2.0 * background
        enough = (height > least) & (flanks > _LEAST_FLANKS * height)
        record[HEIGHT + lane] = height
        record[LIT + lane] = lit if enough else 0.0
    count = 0
    for lane in range(lanes):
        count += record[LIT + lane] > 0.0
    return count


@kernel
def _profile(window: NDArray, lanes: np.uint64, half: np.uint64, record: NDArray) -> None:
    """Centre and width from the samples about the peak that are above a part of it."""
    for lane in range(lanes):
        height = record[HEIGHT + lane]
        record[_ABOVE + lane] = 1.0
        record[_BELOW + lane] = 1.0
        record[_AREA_SUM + lane] = height
        record[_SOFT + lane] = height * (1.0 - _PART)
        record[_MOMENT + lane] = 0.0
    for distance in range(_ONE, half + _ONE):
        up = (half - distance) * LANES
        down = (half + distance) * LANES
        for lane in range(lanes):
            threshold = _PART * record[HEIGHT + lane]
            first = window[up + lane] - record[BACKGROUND + lane]
            second = window[down + lane] - record[BACKGROUND + lane]
            above, below = record[_ABOVE + lane], record[_BELOW + lane]
            above = above if first > threshold else 0.0
            below = below if second > threshold else 0.0
            record[_ABOVE + lane] = above
            record[_BELOW + lane] = below
            record[_AREA_SUM + lane] += above * first + below * second
            first = above * (first - threshold)
            second = below * (second - threshold)
            record[_SOFT + lane] += first + second
            record[_MOMENT + lane] += distance * (second - first)
    for lane in range(lanes):
        record[ROUGH_CENTRE + lane] = record[_MOMENT + lane] / record[_SOFT + lane]
        record[ROUGH_WIDTH + lane] = record[_AREA_SUM + lane] / (_AREA * record[HEIGHT + lane])
