"""Ridge pixels: where the light has a maximum across some direction, to a pixel or so."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.light import Picture

# Standard deviations of the smoothing, px. A line of standard deviation w answers with at least
# 0.79 of its amplitude at the nearest of them for w from 0.7 to 8 px.
SCALES = (1.0, 2.0, 4.0, 6.0)

# A zero of the first derivative may lie this far from the pixel's centre (Steger 1998 takes 0.5;
# the rest keeps chains unbroken where two pixels share the zero).
_REACH_PX = 0.7

# At a line's pixel the curvature along the line is small; a blob or a saddle has two large ones.
_CURVATURE_RATIO = 0.5


@dataclass(frozen=True)
class Ridges:
    """Pixels on ridges of the light.

    Parameters
    ----------
    pixels : (N, 2) int array
        Column and row.
    uv : (N, 2) array
        The ridge near each pixel, px, good to some tenths of a pixel.
    direction : (N, 2) array
        Unit direction along the ridge, of either sign.
    strength : (N,) array
        Amplitude of the line that would answer as strongly, grey levels.
    scale : float
        Smoothing with which they were found, px.
    """

    pixels: NDArray[np.int64]
    uv: Array
    direction: Array
    strength: Array
    scale: float

    def __len__(self) -> int:
        return len(self.pixels)

    def stronger_than(self, strength: float) -> Ridges:
        """The ridge pixels of at least a given strength."""
        keep = self.strength >= strength
        return Ridges(
            self.pixels[keep],
            self.uv[keep],
            self.direction[keep],
            self.strength[keep],
            self.scale,
        )


def ridges(picture: Picture, least_strength: float) -> Ridges:
    """Ridge pixels at the scale that shows the most of the picture's lines.

    C. Steger, "An unbiased detector of curvilinear structures", IEEE PAMI 20(2), 1998:
    a pixel lies on a line where the first derivative across it vanishes inside the pixel and
    the second is strongly negative.

    Parameters
    ----------
    picture : (H, W) float32 array
    least_strength : float
        Amplitude of the faintest line of interest, grey levels.
    """
    found = [ridges_at(picture, scale, least_strength) for scale in SCALES]
    return max(found, key=lambda one: float(np.sum(one.strength**2)))


def ridges_at(picture: Picture, scale: float, least_strength: float) -> Ridges:
    """Ridge pixels at one smoothing `scale` in px; see `ridges`."""
    smooth = cv2.GaussianBlur(picture, (0, 0), scale, borderType=cv2.BORDER_REFLECT_101)
    # A line of standard deviation `scale` and amplitude A has the second derivative
    # A / (2 sqrt(2) scale²) across it after smoothing.
    to_strength = 2.0 * np.sqrt(2.0) * scale**2
    laplacian = cv2.Laplacian(smooth, cv2.CV_32F, ksize=1)
    inner = laplacian[1:-1, 1:-1] * -to_strength >= least_strength * (1.0 - _CURVATURE_RATIO)
    rows, columns = np.nonzero(inner)
    rows, columns = rows + 1, columns + 1
    gradient, hessian = _derivatives(smooth, rows, columns)
    across, along, curvature, other = _principal(hessian)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -np.sum(gradient * across, axis=-1) / curvature
        offset = distance[:, None] * across
        on_ridge = (np.abs(offset) <= _REACH_PX).all(axis=-1)
    strength = -curvature * to_strength
    on_ridge &= (strength >= least_strength) & (np.abs(other) <= _CURVATURE_RATIO * -curvature)
    pixels = np.stack([columns, rows], axis=-1)[on_ridge]
    return Ridges(pixels, pixels + offset[on_ridge], along[on_ridge], strength[on_ridge], scale)


def _derivatives(
    smooth: Picture, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Gradient ``(N, 2)`` and Hessian ``(N, 3)`` (uu, uv, vv) by central differences."""

    def at(down: int, right: int) -> Array:
        return smooth[rows + down, columns + right].astype(float)

    centre, left, right, up, down = at(0, 0), at(0, -1), at(0, 1), at(-1, 0), at(1, 0)
    gradient = np.stack([right - left, down - up], axis=-1) / 2.0
    mixed = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4.0
    hessian = np.stack([right - 2 * centre + left, mixed, down - 2 * centre + up], axis=-1)
    return gradient, hessian


def _principal(hessian: Array) -> tuple[Array, Array, Array, Array]:
    """Directions across and along the ridge, the most negative curvature, and the other."""
    uu, uv, vv = hessian.T
    mean, half = (uu + vv) / 2.0, (uu - vv) / 2.0
    root = np.hypot(half, uv)
    # The direction of the larger eigenvalue runs along the ridge.
    angle = np.arctan2(uv, half) / 2.0
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    return across, along, mean - root, mean + root
