"""Where the numbers of a tile lie, and kernels that every detector needs.

A frame's columns (or rows) are worked on in tiles of `LANES` neighbours, one lane each. What is
known of a tile is its record, one flat array: `LANES` backgrounds, then `LANES` heights, and so
on. All distances in it are constants, so the compiler sees that lanes do not touch one another,
and works on several at once. A window holds the samples about the peaks: `LANES` first ones, then
`LANES` second ones. One record and one window serve all tiles in turn, and stay in the fastest
cache.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel

Index: TypeAlias = int | np.integer

# Unsigned, as all indices of the kernels are: no check for negative ones then stands between the
# compiler and its vector instructions.
LANES = np.uint64(64)
ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)

# What the search hands to a detector. Centres count from the sample of the peak.
(
    BACKGROUND,  # grey levels
    HEIGHT,  # of the brightest sample over the background, grey levels
    ROUGH_CENTRE,  # px from the peak's sample
    ROUGH_WIDTH,  # standard deviation, px
    FIRST,  # first sample of the window that lies in the frame
    LAST,
    LIT,  # 1 where there may be a line, or else 0
    # What a detector hands back
    CENTRE,  # px from the peak's sample
    STD,  # px
    WIDTH,  # px
    PEAK,  # grey levels
    FOUND,  # 1 where the detector found a line, or else 0
) = (np.uint64(slot) * LANES for slot in range(12))
WORK = tuple(np.uint64(slot) * LANES for slot in range(12, 44))  # room for sums
RECORD = np.uint64(44) * LANES


@kernel
def tiles(count: int) -> Index:
    """Tiles that hold so many columns."""
    return (np.uint64(count) + LANES - ONE) // LANES


@kernel
def window_size(half: Index) -> Index:
    """Samples in a window that reaches `half` px to either side of the peaks."""
    return (TWO * half + ONE) * LANES


@kernel
def take(window: NDArray, lanes: Index, start: Index, record: NDArray, slot: Index) -> None:
    """Copy samples into a record, so that the loops that follow touch one array alone.

    The number of lanes comes as an argument. Where the compiler knows it, it drops the check
    that the two arrays lie apart, and with it the vector instructions.
    """
    for lane in range(lanes):
        record[slot + lane] = window[start + lane]


@kernel
def exponential(x: float) -> float:
    """Exponential for −20 < x < 20, to one in a million; vector instructions can do it."""
    z = x / 64.0
    # Taylor's series; times a constant, as the compiler leaves divisions as they stand
    y = 1.0 + z * (1 / 7)
    y = 1.0 + z * (1 / 6) * y
    y = 1.0 + z * (1 / 5) * y
    y = 1.0 + z * (1 / 4) * y
    y = 1.0 + z * (1 / 3) * y
    y = 1.0 + z * (1 / 2) * y
    y = 1.0 + z * y
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    return y * y
