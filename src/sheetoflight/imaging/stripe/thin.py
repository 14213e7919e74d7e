"""Centres of the line as the whole pixels that thinning leaves: the paper's section 4.2.2."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.rows import background_operator, rows_about, wide_rows

_THRESHOLD = 0.5  # of the line's height

# Neighbours of a pixel from above it on clockwise: P2 to P9 in Zhang and Suen's figure.
_AROUND = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))


def thin_centres(light: LineLight, track: Track) -> Located:
    """Binarise at half the line's height, thin, and take the pixel that is left in each row.

    The centre is a whole pixel, whose rounding alone is 0.29 px; where an even number of pixels is
    lit, thinning keeps one of the two middle ones, always on the same side. The paper's way, here
    to be compared with.
    """
    skeleton = thinned(_lit(light, track))
    width = track.width / track.cosine
    half = int(np.ceil(3.0 * width.max(initial=0.5))) + 2
    picture = LineLight(
        skeleton.astype(np.float32),
        np.zeros_like(skeleton),
        light.noise_std,
        light.least_std,
        light.differenced,
    )
    rows = rows_about(picture, track, half)
    offset = rows.x + rows.first[:, None] - track.across[:, None]
    left = (rows.samples > 0) & (rows.weights > 0)
    nearest = np.argmin(np.where(left, np.abs(offset), np.inf), axis=1)
    found = left.any(axis=1) & (np.abs(offset[np.arange(len(offset)), nearest]) < 1.5 * width + 1.0)
    std = _threshold_std(track) * track.cosine
    return Located(track.uv(nearest + rows.first), std, found)


def _lit(light: LineLight, track: Track) -> NDArray[np.bool_]:
    """Pixels about the track brighter than half its height over their row's background, or full."""
    rows, centre, width = wide_rows(light, track)
    level, slope = np.einsum("nk,nkp->pn", rows.samples, background_operator(rows, centre, width))
    x = rows.x - centre[:, None]
    excess = rows.samples - level[:, None] - slope[:, None] * x
    lit = (excess > _THRESHOLD * track.amplitude[:, None]) | rows.full
    lit &= rows.weights > 0
    picture = np.zeros(light.picture.shape, dtype=bool)
    picture_by_rows = picture if track.by_rows else picture.T
    row, column = np.nonzero(lit & (np.abs(x) < 3.0 * width[:, None] + 1.0))
    picture_by_rows[track.along[row], (column + rows.first[row]).astype(np.int64)] = True
    return picture


def _threshold_std(track: Track) -> np.ndarray:
    """How far noise moves the middle of two edges, px along the row."""
    steepness = track.amplitude * _THRESHOLD * np.sqrt(2.0 * np.log(2.0))
    steepness = steepness * track.cosine / track.width
    return track.law.std(_THRESHOLD * track.amplitude) / steepness / np.sqrt(2.0)


def thinned(lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The skeleton of a binary picture ``(H, W)``.

    T. Y. Zhang, C. Y. Suen, "A fast parallel algorithm for thinning digital patterns",
    Communications of the ACM 27(3), 1984.
    """
    padded = np.pad(lit, 1)
    width = padded.shape[1]
    steps = np.array([down * width + right for down, right in _AROUND])
    flat = padded.ravel()
    while True:
        removed = sum(_peeled(flat, steps, first) for first in (True, False))
        if removed == 0:
            return flat.reshape(padded.shape)[1:-1, 1:-1]


def _peeled(flat: NDArray[np.bool_], steps: NDArray[np.int64], first: bool) -> int:
    """Take off one layer from two sides; how many pixels went."""
    index = np.flatnonzero(flat)
    p = flat[index[:, None] + steps]
    count = p.sum(axis=1)
    rises = (~p & np.roll(p, -1, axis=1)).sum(axis=1)
    north, east, south, west = p[:, 0], p[:, 2], p[:, 4], p[:, 6]
    if first:
        sides = ~(north & east & south) & ~(east & south & west)
    else:
        sides = ~(north & east & west) & ~(north & south & west)
    gone = index[(count >= 2) & (count <= 6) & (rises == 1) & sides]
    flat[gone] = False
    return len(gone)
