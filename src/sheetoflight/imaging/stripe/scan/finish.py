"""Results as one value a column, and the last check: a line is not alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.layout import CENTRE, FOUND, LANES, PEAK, STD, WIDTH, Index

_NEIGHBOURS = 2  # columns on either side among which one must hold the line too
_STEEPEST = 4.0  # px that a line may step from one column to the next


@kernel
def keep(record: NDArray, at: NDArray, tile: Index, values: NDArray) -> None:
    """Write the results of a tile into ``(4, N)`` values: centre, std, width and peak."""
    first = np.int64(tile * LANES)
    for lane in range(min(np.int64(LANES), len(at) - first)):
        j, k = first + lane, np.uint64(lane)
        values[0, j] = at[j] + record[CENTRE + k] if record[FOUND + k] > 0.0 else np.nan
        values[1, j] = record[STD + k]
        values[2, j] = record[WIDTH + k]
        values[3, j] = record[PEAK + k]


@kernel
def join(values: NDArray, good: NDArray) -> None:
    """Mark the columns whose line goes on in a near column; NaN for all others.

    Noise and hot pixels now and then look like a line in one column, but hardly so in two
    neighbours at the same height.

    Parameters
    ----------
    values : (4, N) array
        Centre (NaN where none was found), standard uncertainty, width and peak.
    good : (N,) bool array
        Is filled.
    """
    across = values[0]
    good[:] = False
    for apart in range(1, _NEIGHBOURS + 1):
        for j in range(len(across) - apart):
            if abs(across[j + apart] - across[j]) <= _STEEPEST * apart:
                good[j] = True
                good[j + apart] = True
    for j in range(len(across)):
        if not good[j]:
            values[:, j] = np.nan
