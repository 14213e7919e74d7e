"""Where a bright straight line crosses the band: sums along all directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.crossing.band import Band

_STEEPEST_RAD = np.radians(85.0)
_SMOOTHING_PX = 1.0
_LEAST_SUMMED = 5.0
_HALF = 0.5
_WIDTH_OF_HALF = 1.1774  # half a Gaussian's width at half its height, in standard deviations
_WIDTHS = (0.5, 20.0)


@dataclass(frozen=True)
class RoughLine:
    """A line across the target, ``(a − place) cos φ = n sin φ``, as found by sums.

    Parameters
    ----------
    place : float
        Coordinate a where it meets the band's middle, px.
    tilt : float
        φ, radians: 0 where the line is at right angles to the target.
    width : float
        Standard deviation of its profile, px.
    amplitude : float
        Its mean light over the strip's, grey levels.
    significance : float
        Its summed light over the standard deviation of that sum.
    """

    place: float
    tilt: float
    width: float
    amplitude: float
    significance: float

    def distance(self, a: Array, n: Array) -> Array:
        """Signed distance of coordinates from the line, px."""
        return (a - self.place) * np.cos(self.tilt) - n * np.sin(self.tilt)


def brightest_line(
    band: Band, light: Array, seen: NDArray[np.bool_], noise: float
) -> RoughLine | None:
    """The line whose sum of light stands out most; None where too little can be seen.

    Parameters
    ----------
    band : Band
    light : (K, S) array
        Laser light, the strip's own brightness taken away.
    seen : (K, S) bool array
        The places that count.
    noise : float
        Standard deviation of a place's random error, grey levels.
    """
    used = np.flatnonzero(seen.any(axis=1))
    if len(used) < _LEAST_SUMMED:
        return None
    rows, n = seen[used], band.n[used]
    bright = gaussian_filter(np.where(rows, light[used], 0.0), _SMOOTHING_PX)
    bright = np.where(rows, bright, 0.0)
    share = np.where(rows, gaussian_filter(rows.astype(float), _SMOOTHING_PX), 0.0)
    reach = np.abs(n).max()
    # From one direction to the next the line's ends move by half a pixel.
    count = int(np.ceil(2 * _STEEPEST_RAD * reach / _HALF)) | 1
    best, found = 0.0, None
    for tilt in np.linspace(-_STEEPEST_RAD, _STEEPEST_RAD, count):
        shift = np.rint(n * np.tan(tilt)).astype(int)
        total, number = _sheared(bright, shift), _sheared(share, shift)
        enough = number >= max(_LEAST_SUMMED, 0.2 * len(n))
        score = np.where(enough, total / np.sqrt(np.maximum(number, 1.0)), 0.0)
        column = int(np.argmax(score))
        if score[column] > best:
            best = float(score[column])
            mean = total / np.maximum(number, 1.0)
            found = (tilt, column, np.where(enough, mean, 0.0))
    if found is None:
        return None
    tilt, column, profile = found
    width = _half_width(profile, column) * np.cos(tilt) / _WIDTH_OF_HALF
    return RoughLine(
        float(band.a[column]),
        float(tilt),
        float(np.clip(width, *_WIDTHS)),
        float(profile[column]),
        best / noise,
    )


def _sheared(values: Array, shift: NDArray[np.int64]) -> Array:
    """Sums ``(S,)`` over the rows of ``(K, S)``, each moved by its own number of columns."""
    room, columns = int(np.abs(shift).max()), values.shape[1]
    padded = np.pad(values, ((0, 0), (room, room)))
    total = np.zeros(columns)
    for row, by in zip(padded, shift + room, strict=True):
        total += row[by : by + columns]
    return total


def _half_width(profile: Array, peak: int) -> float:
    """Half the width of a peak at half its height, in columns."""
    low = profile < _HALF * profile[peak]
    after = np.flatnonzero(low[peak:])
    before = np.flatnonzero(low[: peak + 1][::-1])
    sides = [int(side[0]) for side in (after, before) if len(side)]
    return float(min(sides, default=1)) - 0.5
