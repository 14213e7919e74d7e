"""Whether a point looks the same upside down, as a corner between squares and a circle do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.saddles import read_at
from sheetoflight.imaging.markers.grey import Picture

_MOST_STEPS = 11
_LEAST, _BEYOND_MOST = 0.05, 3.0
_SHIFT = 0.3
"""What a corner is moved by light on one side: windows per unit of asymmetry, on drawings of a
laser line of 20 to 300 grey values, and much the same on photographs."""


def disturbed(asymmetry: Array) -> NDArray[np.bool_]:
    """Which points ``(M,)`` are much less symmetric than most."""
    usual = np.nanmedian(asymmetry) if np.isfinite(asymmetry).any() else np.nan
    return asymmetry > max(_LEAST, _BEYOND_MOST * usual)


def disturbed_std(std: Array, asymmetry: Array, reach: Array) -> Array:
    """Standard uncertainty ``(M,)`` px of points that are used although they are disturbed."""
    return np.hypot(std, _SHIFT * reach * asymmetry)


def asymmetry(values: Picture, uv: Array, window: NDArray[np.int64]) -> Array:
    """Part ``(M,)`` of a window's contrast that half a turn about the point changes; 0 to 1.

    A line of light beside a point, a reflection and a finger all break the symmetry; light right
    through the middle does not, and does not move the point either.

    Parameters
    ----------
    values : (H, W) float32 array
    uv : (M, 2) array
        Points, px; NaN where not seen.
    window : (M,) int array
        Half the side of each point's window, px.
    """
    share = np.full(len(uv), np.nan)
    seen = np.isfinite(uv).all(axis=1)
    for size in np.unique(window[seen]):
        of_size = seen & (window == size)
        share[of_size] = _asymmetry(values, uv[of_size], int(size))
    return share


def _asymmetry(values: Picture, uv: Array, size: int) -> Array:
    inner = np.linspace(-size, size, 2 * min(size, _MOST_STEPS) + 1)
    offset = np.stack(np.meshgrid(inner, inner), axis=-1)
    patch = read_at(values, uv[:, None, None, :] + offset)
    bell = np.exp(-((inner / size) ** 2))
    weight = bell[:, None] * bell
    mean = (weight * patch).sum(axis=(1, 2), keepdims=True) / weight.sum()
    turned = (patch - patch[:, ::-1, ::-1]) / 2
    odd = (weight * turned**2).sum(axis=(1, 2))
    whole = (weight * (patch - mean) ** 2).sum(axis=(1, 2))
    return np.sqrt(odd / np.maximum(whole, 1e-12))
