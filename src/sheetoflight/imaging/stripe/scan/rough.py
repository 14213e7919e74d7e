"""A first look at a tile: the background, whether there may be a line, and where and how wide."""

from __future__ import annotations

from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.layout import (
    BACKGROUND,
    FIRST,
    FOUND,
    HEIGHT,
    LANES,
    LAST,
    LIT,
    ONE,
    ROUGH_CENTRE,
    ROUGH_WIDTH,
    THREE,
    TWO,
    WORK,
    Index,
)
from sheetoflight.imaging.stripe.scan.windows import gather

_LEAST_FLANKS = 0.25  # light in the peak's two neighbours, as a part of the peak
_PART = 0.3  # of the peak, down to which samples count
_AREA_ABOVE = 2.204  # of a Gaussian of unit height and width above that part
_MARGIN = 2.0  # widths of the line that must lie in the frame on either side of its centre

_SOFT, _MOMENT, _ABOVE, _BELOW, _AREA, _UP, _DOWN = WORK[:7]


@kernel
def look(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    tile: Index,
    lanes: Index,
    half: Index,
    least: float,
    window: NDArray,
    record: NDArray,
) -> bool:
    """Fill a tile's window, and its record with what is known before a detector begins.

    A column may hold a line where its peak rises over the background by `least` grey levels, and
    its two neighbours hold light too.

    Returns
    -------
    bool
        Whether any column may.
    """
    gather(frame, by_rows, at, tile, half, window, record)
    _background(window, lanes, half, record)
    _light(window, lanes, half, least, record)
    lit = False
    for lane in range(LANES):
        lit |= record[LIT + lane] > 0.0
        record[FOUND + lane] = 0.0
    if lit:
        _profile(window, lanes, half, record)
    return lit


@kernel
def _background(window: NDArray, lanes: Index, half: Index, record: NDArray) -> None:
    """Mean of the samples at the window's ends; of one end where the other is cut off."""
    end = (TWO * half - THREE) * LANES
    for lane in range(lanes):
        low = float(window[lane]) + float(window[LANES + lane])
        low += float(window[TWO * LANES + lane]) + float(window[THREE * LANES + lane])
        record[_ABOVE + lane] = low
    for lane in range(lanes):
        here = end + lane
        high = float(window[here]) + float(window[here + LANES])
        high += float(window[here + TWO * LANES]) + float(window[here + THREE * LANES])
        record[_BELOW + lane] = high
    last = 2.0 * half
    for lane in range(LANES):
        low, high = record[_ABOVE + lane], record[_BELOW + lane]
        cut_low, cut_high = record[FIRST + lane] > 0.0, record[LAST + lane] < last
        both = low + high
        both = 2.0 * high if cut_low & (not cut_high) else both
        both = 2.0 * low if cut_high & (not cut_low) else both
        record[BACKGROUND + lane] = 0.125 * both


@kernel
def _light(window: NDArray, lanes: Index, half: Index, least: float, record: NDArray) -> None:
    before = (half - ONE) * LANES
    for lane in range(lanes):
        here = before + lane
        record[_AREA + lane] = window[here + LANES]
        record[_UP + lane] = float(window[here]) + float(window[here + TWO * LANES])
    for lane in range(LANES):
        background, lit = record[BACKGROUND + lane], record[LIT + lane]
        height = record[_AREA + lane] - background
        flanks = record[_UP + lane] - 2.0 * background
        enough = (height > least) & (flanks > _LEAST_FLANKS * height)
        record[HEIGHT + lane] = height
        record[LIT + lane] = lit if enough else 0.0


@kernel
def _profile(window: NDArray, lanes: Index, half: Index, record: NDArray) -> None:
    """Centre and width from the samples about the peak that are above a part of it."""
    for lane in range(LANES):
        height = record[HEIGHT + lane]
        record[_ABOVE + lane] = 1.0
        record[_BELOW + lane] = 1.0
        record[_AREA + lane] = height
        record[_SOFT + lane] = height * (1.0 - _PART)
        record[_MOMENT + lane] = 0.0
    for distance in range(ONE, half + ONE):
        up, down = (half - distance) * LANES, (half + distance) * LANES
        if not _add_pair(window, lanes, up, down, float(distance), record):
            break
    for lane in range(LANES):
        centre = record[_MOMENT + lane] / record[_SOFT + lane]
        width = record[_AREA + lane] / (_AREA_ABOVE * record[HEIGHT + lane])
        lit = record[LIT + lane]
        margin = _MARGIN * width
        inside = (half + centre - margin > record[FIRST + lane]) & (
            half + centre + margin < record[LAST + lane]
        )
        record[ROUGH_CENTRE + lane] = centre
        record[ROUGH_WIDTH + lane] = width
        record[LIT + lane] = lit if inside else 0.0


@kernel
def _add_pair(
    window: NDArray,
    lanes: Index,
    up: Index,
    down: Index,
    distance: float,
    record: NDArray,
) -> bool:
    """Add the samples at one distance from the peak; whether any of them was above."""
    for lane in range(lanes):
        threshold = _PART * record[HEIGHT + lane]
        first = float(window[up + lane]) - record[BACKGROUND + lane]
        second = float(window[down + lane]) - record[BACKGROUND + lane]
        above, below = record[_ABOVE + lane], record[_BELOW + lane]
        above = above if first > threshold else 0.0
        below = below if second > threshold else 0.0
        record[_ABOVE + lane] = above
        record[_BELOW + lane] = below
        record[_AREA + lane] += above * first + below * second
        first = above * (first - threshold)
        second = below * (second - threshold)
        record[_SOFT + lane] += first + second
        record[_MOMENT + lane] += distance * (second - first)
    going = False
    for lane in range(LANES):
        going |= (record[_ABOVE + lane] + record[_BELOW + lane]) * record[LIT + lane] > 0.0
    return going
