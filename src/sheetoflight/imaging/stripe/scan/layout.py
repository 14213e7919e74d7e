"""Where the numbers of a tile lie.

A frame's columns (or rows) are worked on in tiles of `LANES` neighbours, one lane each. What is
known of a tile lies in one flat array: `LANES` backgrounds, then `LANES` heights, and so on. All
distances are constants then, and the compiler can see that lanes do not touch one another and
works on several at once.
"""

from __future__ import annotations

import numpy as np

# Unsigned, as all indices of the kernels are: no check for negative ones then stands between the
# compiler and its vector instructions.
LANES = np.uint64(64)

# What the search hands to a detector. Centres count from the sample of the peak.
(
    BACKGROUND,  # grey levels
    HEIGHT,  # of the brightest sample over the background, grey levels
    ROUGH_CENTRE,  # px from the peak's sample
    ROUGH_WIDTH,  # standard deviation, px
    FIRST,  # first sample of the window that lies in the frame, and is of use
    LAST,
    LIT,  # 1 where there may be a line, or else 0
    # What a detector hands back
    CENTRE,  # px from the peak's sample
    STD,  # px
    WIDTH,  # px
    PEAK,  # grey levels
    FOUND,  # 1 where the detector found a line, or else 0
) = (np.uint64(slot) * LANES for slot in range(12))
WORK = np.uint64(12) * LANES  # from here on, room for sums
RECORD = np.uint64(40) * LANES


def tiles(count: int) -> int:
    """Tiles that hold so many columns."""
    return -(-count // int(LANES))
