"""The picture's own samples about a line, row by row (or column by column)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Track
from sheetoflight.imaging.stripe.light import LineLight

_BACKGROUND = (3.5, 6.0)  # where the surroundings of a line are read, in widths from its centre
_LEAST_BACKGROUND_PX = 2.0


@dataclass(frozen=True)
class Rows:
    """Samples across the line.

    Parameters
    ----------
    samples : (N, K) array
        Grey levels.
    full : (N, K) bool array
        Whether the sensor was full there.
    weights : (N, K) array
        Square roots of weights, 0 outside the picture.
    first : (N,) array
        Pixel coordinate of each row's first sample.
    """

    samples: Array
    full: NDArray[np.bool_]
    weights: Array
    first: Array

    @cached_property
    def x(self) -> Array:
        """Places of the samples from the first one on ``(K,)``, px."""
        return np.arange(self.samples.shape[1], dtype=float)


def rows_about(light: LineLight, track: Track, half: int) -> Rows:
    """The ``2 half + 1`` samples about every rough centre of a track, weight 1 in the picture."""
    picture = light.picture if track.by_rows else light.picture.T
    full = light.full if track.by_rows else light.full.T
    first = np.rint(track.across).astype(np.int64) - half
    columns = first[:, None] + np.arange(2 * half + 1)
    inside = (columns >= 0) & (columns < picture.shape[1])
    index = (track.along[:, None], np.clip(columns, 0, picture.shape[1] - 1))
    return Rows(
        picture[index].astype(float), full[index], inside.astype(float), first.astype(float)
    )


def wide_rows(light: LineLight, track: Track) -> tuple[Rows, Array, Array]:
    """Rows that reach into the surroundings, the rough centres in them ``(N,)``, and the line's
    width along them ``(N,)``, px."""
    width = track.width / track.cosine
    half = int(np.ceil(_BACKGROUND[1] * width.max(initial=0.5) + _LEAST_BACKGROUND_PX)) + 1
    rows = rows_about(light, track, half)
    return rows, track.across - rows.first, width


def background_operator(rows: Rows, centre: Array, width: Array) -> Array:
    """Weights ``(N, K, 2)`` that give level (at the centre) and slope of a row's surroundings.

    Level and slope of the straight line through the means of both sides, from 3.5 to 6 widths off
    the centre. Where one side lies outside the picture the other alone gives the level, and the
    slope is 0.
    """
    offset = rows.x - centre[:, None]
    near, far = (factor * width[:, None] for factor in _BACKGROUND)
    beside = (np.abs(offset) > near) & (np.abs(offset) <= far + _LEAST_BACKGROUND_PX)
    operator = np.zeros((*offset.shape, 2))
    means, places = [], []
    for side in (offset < 0, offset > 0):
        used = beside & side & (rows.weights > 0)
        count = used.sum(axis=1, keepdims=True)
        share = used / np.maximum(count, 1)
        means.append(share)
        places.append(np.sum(share * offset, axis=1, keepdims=True))
    left, right = (mean.any(axis=1, keepdims=True) for mean in means)
    both = left & right
    span = np.where(both, places[1] - places[0], 1.0)
    operator[..., 1] = np.where(both, (means[1] - means[0]) / span, 0.0)
    alone = np.where(left, means[0], means[1])
    operator[..., 0] = np.where(both, means[0] - places[0] * operator[..., 1], alone)
    return operator
