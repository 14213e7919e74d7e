"""A picture's band along the target, and where in it there is plain paper."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.crossing.axis import TargetAxis
from sheetoflight.model.target import MarkerKind

_BEYOND_ENDS = 2.0  # half marker sizes
_BEYOND_AXIS = 3.0  # half marker sizes
_WELL_INSIDE = 0.8
_CLEAR_OF_MARKER = 1.4
# A laser line lights fewer columns than half of so many half marker sizes.
_GROUND_WINDOW = 10.0
_UNLIKE = 0.3
_MARGIN_PX = 2
_INK_QUANTILE = 0.02


@dataclass(frozen=True)
class Band:
    """Places along and across the target, one pixel apart, in columns and rows.

    Parameters
    ----------
    axis : TargetAxis
    a : (S,) array
        Place of each column along the target, px.
    n : (K,) array
        Place of each row across the target, px.
    inside : (K, S) bool array
        Whether a place lies in the picture.
    """

    axis: TargetAxis
    a: Array
    n: Array
    inside: NDArray[np.bool_]

    def read(self, picture: NDArray[np.float32]) -> Array:
        """A picture's values ``(K, S)``, linearly interpolated."""
        grid = self.axis.uv(*np.meshgrid(self.a, self.n)).astype(np.float32)
        read = cv2.remap(
            picture, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(read, dtype=float)

    def at(self, values: NDArray[np.bool_], a: Array, n: Array) -> NDArray[np.bool_]:
        """What ``values`` ``(K, S)`` hold at the nearest place; False beyond the band."""
        row = np.rint(n - self.n[0]).astype(int)
        column = np.rint(a - self.a[0]).astype(int)
        there = (row >= 0) & (row < len(self.n)) & (column >= 0) & (column < len(self.a))
        row, column = np.where(there, row, 0), np.where(there, column, 0)
        return values[row, column] & there

    @property
    def on_target(self) -> NDArray[np.bool_]:
        """``(K, S)``: no farther from the axis than the markers reach, where paper must be."""
        return np.abs(self.n)[:, None] <= self.axis.height_at(self.a)[None, :]

    @property
    def between_markers(self) -> NDArray[np.bool_]:
        """``(S,)``: columns between the outer markers and clear of all."""
        axis = self.axis
        between = (self.a > axis.markers.min()) & (self.a < axis.markers.max())
        room = _CLEAR_OF_MARKER * axis.half_length + _MARGIN_PX
        near = np.abs(self.a[:, None] - axis.markers) < room
        return between & ~near.any(axis=1)


def target_band(axis: TargetAxis, shape: tuple[int, ...]) -> Band:
    """The band of a picture ``(H, W)`` that holds the target's strip."""
    first, last = int(np.argmin(axis.markers)), int(np.argmax(axis.markers))
    low = axis.markers[first] - _BEYOND_ENDS * axis.half_length[first]
    high = axis.markers[last] + _BEYOND_ENDS * axis.half_length[last]
    reach = np.ceil(_BEYOND_AXIS * axis.half_height.max())
    a, n = np.arange(np.ceil(low), high + 1e-9), np.arange(-reach, reach + 1)
    uv = axis.uv(*np.meshgrid(a, n))
    inside = (uv >= 0) & (uv <= np.array(shape[1::-1]) - 1.0)
    return Band(axis, a, n, np.asarray(inside.all(axis=-1)))


def ground(band: Band, values: Array) -> Array:
    """What is seen ``(S,)`` of the bare strip along the target, laser light left out."""
    clear = np.flatnonzero(band.between_markers)
    if not len(clear):
        return np.full(len(band.a), float(np.median(values[band.on_target])))
    inner = np.abs(band.n)[:, None] <= _WELL_INSIDE * band.axis.height_at(band.a[clear])
    columns = np.nanmedian(np.where(inner, values[:, clear], np.nan), axis=0)
    size = min(len(clear), int(_GROUND_WINDOW * band.axis.half_length.mean()) | 1)
    return np.interp(band.a, band.a[clear], median_filter(columns, size, mode="nearest"))


def paper(band: Band, grey: Array, kind: MarkerKind) -> NDArray[np.bool_]:
    """Where the strip is plain ``(K, S)``: off the ink and the strip's borders.

    The strip reaches as far across as the markers do, and on to where its edge is seen; where
    none is seen, what lies beyond the markers may be something else and is left out.

    Parameters
    ----------
    band : Band
    grey : (K, S) array
        Grey values, without the laser where there is such a picture.
    kind : {"quadrant", "disc"}
    """
    level = ground(band, grey)
    discs = _discs(band)
    ink = discs & band.on_target
    if kind == "quadrant":
        contrast = float(np.median(level) - np.quantile(grey[ink], _INK_QUANTILE))
    else:
        contrast = abs(float(np.median(level) - np.median(grey[ink])))
    dark = grey < level - _UNLIKE * contrast
    if kind == "disc":
        dark |= discs
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _MARGIN_PX + 1,) * 2)
    near_dark = np.asarray(cv2.dilate(dark.astype(np.uint8), kernel)) > 0
    unlike = np.abs(grey - level) > _UNLIKE * contrast
    return band.inside & ~near_dark & _within_edges(band, unlike)


def _discs(band: Band) -> NDArray[np.bool_]:
    """The markers' discs, as far as their shear is unknown a little larger."""
    axis, inside = band.axis, np.zeros((len(band.n), len(band.a)), bool)
    shapes = zip(axis.markers, axis.half_length, axis.half_height, strict=True)
    for place, length, height in shapes:
        along = (band.a - place) / (_CLEAR_OF_MARKER * length)
        inside |= along[None, :] ** 2 + (band.n[:, None] / height) ** 2 <= 1.0
    return inside


def _within_edges(band: Band, unlike: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Between the strip's edges, as columns clear of markers show them, with a margin."""
    own = band.axis.height_at(band.a)
    clear = np.flatnonzero(band.between_markers)
    above, below = own, own
    if len(clear):
        above = _edge(band, unlike, clear, own)
        below = _edge(band, unlike[::-1], clear, own)
    n = band.n[:, None]
    return (n <= above - _MARGIN_PX) & (n >= _MARGIN_PX - below)


def _edge(band: Band, unlike: NDArray[np.bool_], clear: NDArray[np.intp], own: Array) -> Array:
    """How far the strip reaches ``(S,)`` towards growing n, in px; at least ``own``."""
    beyond = unlike[:, clear] & (band.n[:, None] > own[clear] - 1.0)
    first = band.n[np.argmax(beyond, axis=0)]
    share = np.where(beyond.any(axis=0), np.maximum(first / own[clear], 1.0), 1.0)
    size = min(len(clear), int(_GROUND_WINDOW * band.axis.half_length.mean()) | 1)
    return own * np.interp(band.a, band.a[clear], median_filter(share, size, mode="nearest"))
