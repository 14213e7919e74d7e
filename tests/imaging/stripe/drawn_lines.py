"""Drawings of lit strips by brute force: an oracle that shares no formula with the detector.

The sheet's profile is sampled on a grid six times as fine as the pixels, cut at the strip's
ends, blurred on that grid, and summed over each pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from sheetoflight.geometry.directions import Array

_FINE = 6
_MARGIN = 14


@dataclass(frozen=True)
class Strip:
    """A straight piece of the line from `first` to `second` (px).

    `sheet`: standard deviation of the light across the line before the blur, px; `shear`: px
    that each end's edge runs along the line per px across; `ambient`: grey levels of the strip
    itself within `half_width` px of the line; `slope`: relative growth of the light per px.
    """

    first: tuple[float, float]
    second: tuple[float, float]
    amplitude: float = 120.0
    sheet: float = 1.0
    blur: float = 0.7
    shear: tuple[float, float] = (0.0, 0.0)
    ambient: float = 0.0
    half_width: float = 15.0
    slope: float = 0.0

    @property
    def ends(self) -> Array:
        return np.array([self.first, self.second])

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    @property
    def along(self) -> Array:
        return (self.ends[1] - self.ends[0]) / self.length

    def offsets(self, ends: Array) -> tuple[Array, Array]:
        """How far found ends ``(2, 2)``, in any order, lie outwards and across, px."""
        if np.linalg.norm(ends[0] - self.ends[0]) > np.linalg.norm(ends[1] - self.ends[0]):
            ends = ends[::-1]
        error = ends - self.ends
        across = np.array([-self.along[1], self.along[0]])
        return (error @ self.along) * [-1.0, 1.0], error @ across


def drawn(shape: tuple[int, int], *strips: Strip) -> Array:
    """Noise-free light ``(H, W)`` of strips in the dark, grey levels."""
    picture = np.zeros(shape)
    for strip in strips:
        _add(picture, strip)
    return picture


def _add(picture: Array, strip: Strip) -> None:
    reach = _MARGIN + 4.0 * strip.sheet + (strip.half_width if strip.ambient else 0.0)
    low = np.floor(strip.ends.min(axis=0) - reach).astype(int)
    high = np.ceil(strip.ends.max(axis=0) + reach).astype(int)
    columns, rows = (_fine_grid(a, b) for a, b in zip(low, high, strict=True))
    u, v = np.meshgrid(columns - strip.first[0], rows - strip.first[1])
    s = u * strip.along[0] + v * strip.along[1]
    t = v * strip.along[0] - u * strip.along[1]
    lit = strip.amplitude * (1.0 + strip.slope * s) * np.exp(-0.5 * (t / strip.sheet) ** 2)
    lit += strip.ambient * (np.abs(t) < strip.half_width)
    lit *= _soft(s - strip.shear[0] * t, strip.shear[0])
    lit *= _soft(strip.length - s + strip.shear[1] * t, strip.shear[1])
    lit = gaussian_filter(lit, strip.blur * _FINE, truncate=6.0)
    size = (high - low + 1)[::-1]
    pixels = lit.reshape(size[0], _FINE, size[1], _FINE).mean(axis=(1, 3))
    height, width = picture.shape
    top, left = max(low[1], 0), max(low[0], 0)
    bottom, right = min(high[1], height - 1) + 1, min(high[0], width - 1) + 1
    picture[top:bottom, left:right] += pixels[
        top - low[1] : bottom - low[1], left - low[0] : right - low[0]
    ]


def _fine_grid(low: int, high: int) -> Array:
    return (np.arange((high - low + 1) * _FINE) + 0.5) / _FINE - 0.5 + low


def _soft(distance: Array, shear: float) -> Array:
    """Part of each fine cell that lies inside an edge."""
    return np.clip(distance / np.sqrt(1.0 + shear**2) * _FINE + 0.5, 0.0, 1.0)


def recorded(
    light: Array, rng: np.random.Generator, noise: float = 2.0, dark: float = 20.0
) -> NDArray[np.uint8]:
    """An 8-bit picture with normal noise over a dark level."""
    return np.clip(np.rint(light + dark + rng.normal(0.0, noise, light.shape)), 0, 255).astype(
        np.uint8
    )


def random_strip(rng: np.random.Generator, centre: float = 110.0, **changes: object) -> Strip:
    """A strip of 60 to 150 px in any direction, its ends cut up to 30° off square."""
    angle, length = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(60.0, 150.0)
    middle = centre + rng.uniform(-1.0, 1.0, 2)
    half = length / 2.0 * np.array([np.cos(angle), np.sin(angle)])
    first, second = middle - half, middle + half
    strip = Strip(
        (float(first[0]), float(first[1])),
        (float(second[0]), float(second[1])),
        amplitude=float(rng.uniform(100.0, 150.0)),
        shear=(float(rng.uniform(-0.6, 0.6)), float(rng.uniform(-0.6, 0.6))),
    )
    return replace(strip, **changes)
