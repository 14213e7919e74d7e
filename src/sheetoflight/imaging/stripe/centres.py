"""Where to look for centres of the line, and what was found there."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.noise import NoiseLaw


@dataclass(frozen=True)
class Track:
    """Where to look: one row or column after another, with a rough centre for each.

    Parameters
    ----------
    along : (N,) int array
        The rows (columns) of the picture.
    across : (N,) array
        Rough centre in each, px.
    by_rows : bool
        Whether `along` counts rows and `across` columns, or the other way round.
    slope : (N,) array
        Absolute change of `across` from one to the next.
    width : (N,) array
        Rough standard deviation of the line's profile across the line, px.
    amplitude : (N,) array
        Rough height of the line over its surroundings, grey levels.
    law : NoiseLaw
        Noise of the samples about the line.
    """

    along: NDArray[np.int64]
    across: Array
    by_rows: bool
    slope: Array
    width: Array
    amplitude: Array
    law: NoiseLaw

    @property
    def cosine(self) -> Array:
        """Length across the line of a step of 1 px along the row or column ``(N,)``."""
        return 1.0 / np.sqrt(1.0 + self.slope**2)

    def uv(self, across: Array) -> Array:
        """Image points ``(N, 2)`` of centres in the track's rows or columns."""
        pair = (across, self.along) if self.by_rows else (self.along, across)
        return np.stack(pair, axis=-1).astype(float)


@dataclass(frozen=True)
class Located:
    """What a detector found along a track.

    Parameters
    ----------
    uv : (N, 2) array
        Centres, px.
    std : (N,) array
        Standard uncertainty of each centre across the line, px.
    good : (N,) bool array
        Whether the detector came to rest at a line.
    """

    uv: Array
    std: Array
    good: NDArray[np.bool_]


@dataclass(frozen=True)
class Centres:
    """Least-squares fits of Gaussians along a track; arrays ``(N,)`` of one value for each centre.

    Parameters
    ----------
    uv : (N, 2) array
        Centres, px.
    std : (N,) array
        Standard uncertainty of each centre across the line, px.
    width : (N,) array
        Standard deviation of the line's profile across the line, px.
    amplitude : (N,) array
        Height of the line over its surroundings, grey levels.
    amplitude_std : (N,) array
        Standard uncertainty of the amplitude.
    dark_variance, variance_per_level : (N,) arrays
        Noise law of the samples about the centre, see `NoiseLaw`.
    by_rows : (N,) bool array
        Whether the centre is that of a row or that of a column.
    good : (N,) bool array
        Whether the detector came to rest at a line.
    """

    uv: Array
    std: Array
    width: Array
    amplitude: Array
    amplitude_std: Array
    dark_variance: Array
    variance_per_level: Array
    by_rows: NDArray[np.bool_]
    good: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.uv)

    def taken(self, index: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Centres:
        """Some of the centres."""
        return Centres(**{one.name: getattr(self, one.name)[index] for one in fields(self)})


def joined(parts: list[Centres]) -> Centres:
    """Several runs of centres, one after another."""
    return Centres(
        **{
            one.name: np.concatenate([getattr(part, one.name) for part in parts])
            for one in fields(Centres)
        }
    )
