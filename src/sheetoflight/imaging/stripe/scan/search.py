"""The brightest sample of every column, or row: the one step that reads the whole frame.

The order of reading decides the speed: the frame is read once, from its first byte to its last,
and what is kept of it (a running maximum for each column) stays in the fastest cache. The place
of a maximum is known at first only as a block of rows, in as few bits as a sample has, so that
one instruction compares as many columns as fit in a register. The exact row is then looked for in
the winning block alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel

_BLOCK = 8
_CHUNK = 64


@kernel
def column_peaks(frame: NDArray, top: NDArray, winner: NDArray, at: NDArray) -> None:
    """Greatest sample of each column and its row; the middle row where several are equal.

    Parameters
    ----------
    frame : (H, W) array
        8 or 16 bit, C-contiguous.
    top : (W,) array
        Of the frame's type; is filled with the maxima.
    winner : (W,) array
        The same; is filled with the winning blocks of rows.
    at : (W,) int64 array
        Is filled with the rows.
    """
    rows, columns = frame.shape
    block = max(_BLOCK, -(-rows // 255))
    running = np.empty(columns, frame.dtype)
    top[:] = 0
    winner[:] = 0
    for first in range(0, rows, block):
        _block_maxima(frame, first, min(first + block, rows), running)
        _keep_greater(running, top, winner, frame.dtype.type(first // block))
    for j in range(columns):
        row = int(winner[j]) * block
        while frame[row, j] != top[j]:
            row += 1
        last = row
        while last + 1 < rows and frame[last + 1, j] == top[j]:
            last += 1
        at[j] = (row + last) // 2


@kernel
def _block_maxima(frame: NDArray, first: int, end: int, running: NDArray) -> None:
    """One row after another: several at a time read at little over half the speed."""
    columns = frame.shape[1]
    row = frame[first]
    for j in range(columns):
        running[j] = row[j]
    for i in range(first + 1, end):
        row = frame[i]
        for j in range(columns):
            running[j] = max(running[j], row[j])


@kernel
def _keep_greater(running: NDArray, top: NDArray, winner: NDArray, index: int) -> None:
    for j in range(len(running)):
        new, old, block = running[j], top[j], winner[j]
        greater = new > old
        top[j] = new if greater else old
        winner[j] = index if greater else block


@kernel
def row_peaks(frame: NDArray, top: NDArray, at: NDArray) -> None:
    """Greatest sample of each row and its column; the middle one where several are equal.

    Parameters
    ----------
    frame : (H, W) array
        8 or 16 bit, C-contiguous.
    top : (H,) array
        Of the frame's type; is filled with the maxima.
    at : (H,) int64 array
        Is filled with the columns.
    """
    rows, columns = frame.shape
    for i in range(rows):
        row = frame[i]
        best = _greatest(row)
        # A line lies near where it was in the row before.
        first = max(at[max(i - 1, 0)] - _CHUNK // 2, 0) if i else 0
        if not _holds(row[first : first + _CHUNK], best):
            first = 0
            while not _holds(row[first : first + _CHUNK], best):
                first += _CHUNK
        while row[first] != best:
            first += 1
        last = first
        while last + 1 < columns and row[last + 1] == best:
            last += 1
        top[i] = best
        at[i] = (first + last) // 2


@kernel
def _greatest(samples: NDArray) -> int:
    greatest = samples[0]
    for k in range(len(samples)):  # by index: only so are 16 bit worked on in vectors
        greatest = max(greatest, samples[k])
    return greatest


@kernel
def _holds(samples: NDArray, value: int) -> bool:
    held = False
    for k in range(len(samples)):
        held |= samples[k] == value
    return held
