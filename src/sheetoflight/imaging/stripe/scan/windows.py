"""The samples about the peaks, and the noise and full scale of the frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.layout import FIRST, LANES, LAST, LIT, ONE, THREE, TWO, Index

_FOUR = np.uint64(4)
_NOISE_ROWS = 8
_LEAST_DIFFERENCES = 200
_NOISE_TRIPLES = 128  # of neighbours in each row
_MEDIAN = 0.6745  # of the absolute value, in standard deviations
_CUT = 3.0  # standard deviations
_CUT_VARIANCE = 0.9733  # of a normal variable cut there
_LEAST_PLATEAU = 3  # samples
_LEAST_PLATEAUS = 3  # columns


@kernel
def gather(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    tile: Index,
    half: Index,
    window: NDArray,
    record: NDArray,
) -> None:
    """Samples about the peaks of a tile, and which of them lie in the frame.

    Parameters
    ----------
    frame : (H, W) array
    by_rows : bool
        Whether there is one peak in every row.
    at : (N,) int64 array
        Peaks, px.
    tile : int
    half : int
        Samples on either side of the peak.
    window : ((2 half + 1) · LANES,) array
        Of the frame's type; is filled; the frame's edge repeats outside the frame.
    record : (RECORD,) array
        FIRST, LAST and LIT are filled; LIT with 1, but 0 where the frame has no more columns.
    """
    flat = frame.reshape(-1)
    height, width = frame.shape
    across = np.uint64(1 if by_rows else width)
    along = width if by_rows else 1
    length = width if by_rows else height
    side = np.int64(half)
    start = np.empty(LANES, np.uint64)
    inside = True
    for lane in range(LANES):
        j = np.int64(tile * LANES + lane)
        record[LIT + lane] = 1.0 if j < len(at) else 0.0
        j = min(j, len(at) - 1)
        record[FIRST + lane] = max(0, side - at[j])
        record[LAST + lane] = min(2 * side, length - 1 - at[j] + side)
        inside &= side <= at[j] < length - side
        start[lane] = j * along + (at[j] - side) * np.int64(across)
    size = TWO * half + ONE
    if inside:
        _gather_inside(flat, across, start, size, window)
    else:
        _gather_at_edge(flat, across, start, size, record, window)


@kernel
def _gather_inside(
    flat: NDArray, across: Index, start: NDArray, size: Index, window: NDArray
) -> None:
    """Four samples of a lane at a time: half the instructions of one at a time."""
    fours = size // _FOUR
    for group in range(fours):
        k = group * _FOUR
        first, second = k * across, (k + ONE) * across
        third, fourth = second + across, second + TWO * across
        for lane in range(LANES):
            here, there = start[lane], k * LANES + lane
            window[there] = flat[here + first]
            window[there + LANES] = flat[here + second]
            window[there + TWO * LANES] = flat[here + third]
            window[there + THREE * LANES] = flat[here + fourth]
    for k in range(fours * _FOUR, size):
        for lane in range(LANES):
            window[k * LANES + lane] = flat[start[lane] + k * across]


@kernel
def _gather_at_edge(
    flat: NDArray,
    across: Index,
    start: NDArray,
    size: Index,
    record: NDArray,
    window: NDArray,
) -> None:
    for k in range(size):
        for lane in range(LANES):
            sample = np.uint64(min(max(k, record[FIRST + lane]), record[LAST + lane]))
            # A start before the frame has wrapped round, and comes back here.
            window[k * LANES + lane] = flat[start[lane] + sample * across]


@kernel
def full_scale(frame: NDArray, by_rows: bool, top: NDArray, at: NDArray) -> float:
    """Grey level at which samples are full: the frame's own greatest, where lines are flat at
    it, or else the greatest of its type."""
    greatest = 0
    for j in range(len(top)):
        greatest = max(greatest, int(top[j]))
    flat = 0
    for j in range(len(top)):
        if int(top[j]) == greatest:
            length = 1
            line = frame[j] if by_rows else frame[:, j]
            for step in (-1, 1):
                i = at[j] + step
                while 0 <= i < len(line) and int(line[i]) == greatest:
                    length += 1
                    i += step
            flat += length >= _LEAST_PLATEAU
    return float(greatest if flat >= _LEAST_PLATEAUS else 256**frame.itemsize - 1)


@kernel
def noise_std(frame: NDArray, by_rows: bool, at: NDArray, half: Index) -> float:
    """Standard deviation of the noise, rounding included, grey levels.

    From second differences ``a − 2b + c`` along a few rows, whose variance is six times that of
    the noise, and which a slow change of the light does not reach. Samples within `half` px of
    the peaks are left out, where enough remain. The median of the absolute values shows how large
    they may be; those up to three standard deviations give the rest.
    """
    differences = np.empty(_NOISE_ROWS * _NOISE_TRIPLES, np.int32)
    count = _differences(frame, by_rows, at, half, differences)
    if count < _LEAST_DIFFERENCES:
        count = _differences(frame, by_rows, at, -1, differences)
    differences = differences[:count]
    limit = _CUT * max((_median(differences) + 0.5) / _MEDIAN, 1.0)
    total, kept = 0.0, 0
    for value in differences:
        if value <= limit:
            total += float(value) * value
            kept += 1
    return np.sqrt(max(total / (6.0 * _CUT_VARIANCE * max(kept, 1)), 1.0 / 12.0))


@kernel
def _differences(
    frame: NDArray, by_rows: bool, at: NDArray, half: Index, differences: NDArray
) -> int:
    """Absolute second differences of triples that do not overlap; how many they are."""
    rows, columns = frame.shape
    triples = min(columns // 3, _NOISE_TRIPLES)
    lines = min(rows, _NOISE_ROWS)
    count = 0
    for n in range(lines):
        i = (2 * n + 1) * rows // (2 * lines)
        row = frame[i]
        first = (columns - 3 * triples) * (n % 4) // 3
        for k in range(triples):
            j = first + 3 * k
            apart = abs(j + 1 - at[i]) if by_rows else abs(i - at[j + 1])
            second = np.int64(row[j]) - 2 * np.int64(row[j + 1]) + np.int64(row[j + 2])
            differences[count] = abs(second)
            count += apart > half
    return count


@kernel
def _median(values: NDArray) -> int:
    """Median of whole numbers, bit by bit from the highest."""
    greatest = 0
    for value in values:
        greatest = max(greatest, value)
    bit = 1
    while 2 * bit <= greatest:
        bit *= 2
    median = 0
    while bit:
        trial = np.int32(median + bit)
        below = 0
        for value in values:
            below += value < trial
        median = trial if 2 * below <= len(values) else median
        bit //= 2
    return int(median)
