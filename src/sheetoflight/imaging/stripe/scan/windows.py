"""Windows of samples about the peaks, and the noise and full scale of the frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.layout import FIRST, LANES, LAST, LIT, RECORD

_ONE, _TWO = np.uint64(1), np.uint64(2)
_NOISE_ROWS = 16
_NOISE_COLUMNS = 128
_MEDIAN = 0.6745  # of the absolute value, in standard deviations
_CUT = 3.0  # standard deviations
_CUT_VARIANCE = 0.9733  # of a normal variable cut there
_LEAST_PLATEAU = 3  # samples
_LEAST_PLATEAUS = 3  # columns


@kernel
def gather(
    frame: NDArray, by_rows: bool, at: NDArray, half: np.uint64, windows: NDArray, records: NDArray
) -> None:
    """Samples about every peak, tile by tile, and which of them lie in the frame.

    Parameters
    ----------
    frame : (H, W) array
    by_rows : bool
        Whether there is one peak in every row.
    at : (N,) int64 array
        Peaks, px.
    half : int
        Samples on either side of the peak.
    windows : (tiles · (2 half + 1) · LANES,) float32 array
        Is filled; the frame's edge repeats outside the frame.
    records : (tiles · RECORD,) array
        FIRST, LAST and LIT are filled.
    """
    flat = frame.reshape(-1)
    height, width = frame.shape
    across = np.uint64(1 if by_rows else width)
    along = width if by_rows else 1
    length = width if by_rows else height
    side = np.int64(half)
    size = _TWO * half + _ONE
    start = np.empty(LANES, np.uint64)
    for tile in range(np.uint64(len(records)) // RECORD):
        record = records[tile * RECORD : (tile + _ONE) * RECORD]
        window = windows[tile * size * LANES : (tile + _ONE) * size * LANES]
        inside = True
        for lane in range(LANES):
            j = np.int64(tile * LANES + lane)
            record[LIT + lane] = 1.0 if j < len(at) else 0.0
            j = min(j, len(at) - 1)
            record[FIRST + lane] = max(0, side - at[j])
            record[LAST + lane] = min(2 * side, length - 1 - at[j] + side)
            inside &= side <= at[j] < length - side
            start[lane] = j * along + (at[j] - side) * np.int64(across)
        if inside:
            for k in range(size):
                for lane in range(LANES):
                    window[k * LANES + lane] = flat[start[lane] + k * across]
        else:
            _gather_at_edge(flat, across, start, size, record, window)


@kernel
def _gather_at_edge(
    flat: NDArray,
    across: np.uint64,
    start: NDArray,
    size: np.uint64,
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
def noise_std(frame: NDArray) -> float:
    """Standard deviation of the noise, rounding included, grey levels.

    From second differences ``a − 2b + c`` along a few rows, whose variance is six times that of
    the noise, and which a slow change of the light does not reach. The median of their absolute
    values shows how large they may be; those up to three standard deviations give the rest.
    """
    rows, columns = frame.shape
    taken = min(columns, _NOISE_COLUMNS + 2)
    count = min(rows, _NOISE_ROWS)
    differences = np.empty(count * (taken - 2), np.int32)
    for n in range(count):
        row = frame[(2 * n + 1) * rows // (2 * count)]
        first = (columns - taken) * (n % 4) // 3
        for k in range(taken - 2):
            i = first + k
            second = int(row[i]) - 2 * int(row[i + 1]) + int(row[i + 2])
            differences[n * (taken - 2) + k] = abs(second)
    limit = _CUT * max((_median(differences) + 0.5) / _MEDIAN, 1.0)
    total = 0
    kept = 0
    for value in differences:
        within = value <= limit
        total += value * value if within else 0
        kept += within
    return np.sqrt(max(total / (6.0 * _CUT_VARIANCE * max(kept, 1)), 1.0 / 12.0))


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
    return median
