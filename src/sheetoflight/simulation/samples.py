"""Where a tile of the picture is sampled, and how its samples become pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array
from sheetoflight.simulation.paint import Chart
from sheetoflight.simulation.rays import RayGrid

_MILD = 1.05
"""Ratio of depths within a block up to which its middle stands for all of it."""


@dataclass(frozen=True)
class Samples:
    """Rays ``(x, y, 1)`` of a block of samples.

    Parameters
    ----------
    x, y : (n, m) arrays
        Ideal normalised image coordinates.
    per_px : (2, 2) array
        Change of ``(x, y)`` per pixel along u and v in the middle of the block.
    footprint_px : float
        Width over which a sample averages, px.
    """

    x: Array
    y: Array
    per_px: Array
    footprint_px: float

    def linear(self, row: Array) -> Array:
        """``row · (x, y, 1)`` at every sample."""
        return row[0] * self.x + (row[1] * self.y + row[2])

    @property
    def middle(self) -> Samples:
        """The one sample in the middle of the block."""
        i, j = (n // 2 for n in self.x.shape)
        at = np.s_[i : i + 1, j : j + 1]
        return Samples(self.x[at], self.y[at], self.per_px, self.footprint_px)

    @property
    def corners(self) -> Samples:
        """The four samples at the corners of the block."""
        at = np.ix_((0, -1), (0, -1))
        return Samples(self.x[at], self.y[at], self.per_px, self.footprint_px)

    def charted(self, rows: Array) -> Chart:
        """Coordinates ``(rows[0]·r, rows[1]·r) / rows[2]·r`` of every ray r on a surface.

        Their change per pixel is taken in the middle of the block where perspective hardly
        changes across it: it only sets how soft an edge is, not where it lies.
        """
        depth = self.linear(rows[2])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = self.linear(rows[0]) / depth, self.linear(rows[1]) / depth
        ends = self.corners.linear(rows[2])
        if ends.min() > 0 and ends.max() < _MILD * ends.min():
            base = self.middle.charted_slopes(rows)
        else:
            base = self.charted_slopes(rows)
        return Chart(a, b, base[0], base[1], self.footprint_px)

    def charted_slopes(self, rows: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Change of both surface coordinates per pixel along u and along v."""
        depth = self.linear(rows[2])
        with np.errstate(divide="ignore", invalid="ignore"):
            a_slopes, b_slopes = (self._slopes(row, rows[2], depth) for row in rows[:2])
        return a_slopes, b_slopes

    def _slopes(self, row: Array, under: Array, depth: Array) -> tuple[Array, Array]:
        value = self.linear(row) / depth
        by_x, by_y = ((row[i] - value * under[i]) / depth for i in range(2))
        along_u, along_v = (by_x * self.per_px[0, i] + by_y * self.per_px[1, i] for i in range(2))
        return along_u, along_v


@dataclass(frozen=True)
class Tile:
    """A block of pixels and the border of pixels whose light reaches into it."""

    rows: range
    columns: range
    border: int

    @property
    def window(self) -> tuple[slice, slice]:
        """Index of the tile in the picture."""
        return slice(self.rows.start, self.rows.stop), slice(self.columns.start, self.columns.stop)

    def coarse(self, grid: RayGrid, border: int, footprint_px: float) -> Samples:
        """One sample a pixel, in the tile and `border` pixels around it."""
        x, y = grid.block(_widened(self.rows, border), _widened(self.columns, border))
        return Samples(x, y, _per_px(x, y), footprint_px)

    def fine(self, grid: RayGrid, sampling: int) -> Samples:
        """``sampling²`` samples a pixel, in the tile and its border."""
        wide = self.border + 1
        x, y = grid.block(_widened(self.rows, wide), _widened(self.columns, wide))
        down = _interpolation(len(self.rows) + 2 * self.border, sampling)
        across = _interpolation(len(self.columns) + 2 * self.border, sampling).T
        return Samples(down @ x @ across, down @ y @ across, _per_px(x, y), 1.0 / sampling)

    def pixels(self, fine: Array, sampling: int, defocus_px: float) -> Array:
        """Pixels of the tile from its fine samples: lens blur, then the pixel's own area."""
        down = blur_weights(len(self.rows), self.border, sampling, defocus_px)
        across = blur_weights(len(self.columns), self.border, sampling, defocus_px)
        return down @ fine @ across.T


def tiles(width: int, height: int, size: int, border: int) -> list[Tile]:
    """Tiles of at most ``size × size`` px that cover a picture."""
    return [
        Tile(range(v, min(v + size, height)), range(u, min(u + size, width)), border)
        for v in range(0, height, size)
        for u in range(0, width, size)
    ]


def blur_border(defocus_px: float) -> int:
    """Pixels around a tile from which light still reaches into it."""
    return math.ceil(4.5 * defocus_px) + 1


@lru_cache(maxsize=64)
def blur_weights(pixels: int, border: int, sampling: int, defocus_px: float) -> Array:
    """Weights ``(pixels, (pixels + 2 border)·sampling)`` of the samples in each pixel.

    A Gaussian of `defocus_px` integrated over the pixel. The samples themselves average over
    1/sampling px; that much variance, ``1/(12 sampling²)``, is taken off the Gaussian.
    """
    at = (np.arange((pixels + 2 * border) * sampling) + 0.5) / sampling - 0.5 - border
    away = at - np.arange(pixels)[:, None]
    sigma = math.sqrt(max(defocus_px**2 - 1.0 / (12 * sampling**2), 0.0))
    if sigma > 0:
        weights = ndtr((away + 0.5) / sigma) - ndtr((away - 0.5) / sigma)
    else:
        weights = (np.abs(away) < 0.5).astype(float)
    weights /= weights.sum(axis=1, keepdims=True)
    weights.setflags(write=False)
    return weights


@lru_cache(maxsize=64)
def _interpolation(pixels: int, sampling: int) -> Array:
    """Linear interpolation ``(pixels·sampling, pixels + 2)`` from pixel centres to samples."""
    at = (np.arange(pixels * sampling) + 0.5) / sampling + 0.5
    nodes = np.arange(pixels + 2)
    weights = np.clip(1.0 - np.abs(at[:, None] - nodes), 0.0, None)
    weights.setflags(write=False)
    return weights


def _widened(pixels: range, by: int) -> range:
    return range(pixels.start - by, pixels.stop + by)


def _per_px(x: Array, y: Array) -> Array:
    """Change ``(2, 2)`` of (x, y) per pixel along u and v, in the middle of a block."""
    i, j = (n // 2 for n in x.shape)
    return np.array(
        [
            [x[i, j] - x[i, j - 1], x[i, j] - x[i - 1, j]],
            [y[i, j] - y[i, j - 1], y[i, j] - y[i - 1, j]],
        ]
    )
