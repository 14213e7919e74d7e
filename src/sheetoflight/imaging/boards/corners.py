"""Corners to a fraction of a pixel, and how well each is known."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.grey import GreyPicture, Picture

_LARGEST_WINDOW = 11
"""Half the window's side, px, that published calibrations with printed boards were made with."""

_SMALLEST_WINDOW = 2
_CLEAR_OF_NEIGHBOURS = 1.5
_SYSTEMATIC_PX = 0.06
"""Error of a corner in a picture without noise times the root of its window, measured on drawings:
pixels are sums over squares, and slopes differences of pixels."""

_STEPS, _STILL_PX = 50, 1e-4


def windows(room: Array) -> NDArray[np.int64]:
    """Half the side ``(M,)`` px of the window in which each corner is measured.

    Parameters
    ----------
    room : (M,) array
        Half the side of the square that is free of other lines of the board, px.
    """
    free = np.floor(room - _CLEAR_OF_NEIGHBOURS)
    return np.clip(free, _SMALLEST_WINDOW, _LARGEST_WINDOW).astype(np.int64)


def refined(picture: GreyPicture, uv: Array, window: NDArray[np.int64]) -> Array:
    """Corners ``(M, 2)`` px where all grey slopes of the window are square to the way to them.

    Förstner and Gülch, "A fast operator for detection and precise location of distinct points",
    ISPRS Intercommission Workshop 1987, as OpenCV's ``cornerSubPix`` has it.
    """
    found = np.array(uv, dtype=float)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, _STEPS, _STILL_PX)
    for size in np.unique(window):
        of_size = window == size
        start = np.ascontiguousarray(uv[of_size], dtype=np.float32).reshape(-1, 1, 2)
        side = (int(size), int(size))
        corners = cv2.cornerSubPix(picture.values, start, side, (-1, -1), criteria)
        found[of_size] = np.asarray(corners, dtype=float).reshape(-1, 2)
    return found


def corner_std(picture: GreyPicture, uv: Array, window: NDArray[np.int64]) -> Array:
    """Standard uncertainty ``(M,)`` px of refined corners, from the grey values' noise.

    The corner q solves ``Σ w g gᵀ (q − p) = 0`` over the pixels p of the window with slopes g.
    To first order the noise of the grey values moves it by ``G⁻¹ δ Σ w g gᵀ (p − q)``,
    ``G = Σ w g gᵀ``; each grey value has a part in the slopes of its four neighbours. What is left
    without noise is added as independent.
    """
    std = np.full(len(uv), np.nan)
    for size in np.unique(window):
        of_size = window == size
        noise = picture.noise * _spread(picture.values, uv[of_size], int(size))
        std[of_size] = np.hypot(noise, _SYSTEMATIC_PX / np.sqrt(size))
    return std


def _spread(values: Picture, uv: Array, size: int) -> Array:
    """Standard uncertainty ``(M,)`` for grey values of noise 1; NaN where no corner is."""
    whole = np.rint(uv).astype(int)
    reach = np.arange(-size - 1, size + 2)
    rows = np.clip(whole[:, 1, None] + reach, 0, values.shape[0] - 1)
    columns = np.clip(whole[:, 0, None] + reach, 0, values.shape[1] - 1)
    patch = values[rows[:, :, None], columns[:, None, :]].astype(float)
    along_u = (patch[:, 1:-1, 2:] - patch[:, 1:-1, :-2]) / 2
    along_v = (patch[:, 2:, 1:-1] - patch[:, :-2, 1:-1]) / 2
    slope = np.stack([along_u, along_v], axis=-1)
    inner = np.arange(-size, size + 1)
    offset = np.stack(np.meshgrid(inner, inner), axis=-1) - (uv - whole)[:, None, None, :]
    bell = np.exp(-((inner / size) ** 2))
    weighted = slope * (bell[:, None] * bell)[..., None]
    information = np.einsum("mijk,mijl->mkl", weighted, slope)
    by_grey_value = _by_grey_value(weighted, offset)
    noise = np.einsum("mijk,mijl->mkl", by_grey_value, by_grey_value)
    return _root_mean(information, noise)


def _by_grey_value(weighted: Array, offset: Array) -> Array:
    """Derivative ``(M, n, n, 2)`` of ``Σ w g (g · offset)`` by each grey value of the patch.

    weighted : w g, ``(M, n − 2, n − 2, 2)``; offset : from the corner, of the same shape, px.
    """
    count, side = weighted.shape[:2]
    derivative = np.zeros((count, side + 2, side + 2, 2))
    along_u, along_v = weighted * offset[..., :1], weighted * offset[..., 1:]
    # On a blurred edge the slopes beside its middle line are not square to the way to the corner.
    skew = (weighted * offset).sum(axis=-1)
    along_u[..., 0] += skew
    along_v[..., 1] += skew
    derivative[:, 1:-1, 2:] += along_u / 2
    derivative[:, 1:-1, :-2] -= along_u / 2
    derivative[:, 2:, 1:-1] += along_v / 2
    derivative[:, :-2, 1:-1] -= along_v / 2
    return derivative


def _root_mean(information: Array, noise: Array) -> Array:
    """Root mean variance of ``G⁻¹ N G⁻¹``; NaN where G is singular."""
    size = np.trace(information, axis1=1, axis2=2)
    regular = np.linalg.det(information) > 1e-6 * np.maximum(size, 1e-12) ** 2
    std = np.full(len(information), np.nan)
    inverse = np.linalg.inv(information[regular])
    covariance = inverse @ noise[regular] @ inverse
    std[regular] = np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 2)
    return std
