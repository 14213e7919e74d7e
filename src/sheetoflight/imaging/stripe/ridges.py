"""Ridge pixels: where the light has a maximum across some direction, to a pixel or so."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.light import LineLight, Picture

# Standard deviations of the smoothing, px. A line of standard deviation w answers with at least
# 0.79 of its amplitude at the nearest of them for w from 0.7 to 8 px.
SCALES = (1.0, 2.0, 4.0, 6.0)

# A zero of the first derivative may lie this far from the pixel's centre (Steger 1998 takes 0.5;
# the rest keeps chains unbroken where two pixels share the zero).
_REACH_PX = 0.7

# At a line's pixel the curvature along the line is small; a blob or a saddle has two large ones.
_CURVATURE_RATIO = 0.5

# Beside a line, this many scales away, the smooth light has fallen by 0.4 to 0.8 of the strength.
_SIDE_SCALES, _LEAST_FALL = 2.5, 0.2

# How far a line must stand out from its surroundings, in standard deviations of their answer,
# and the size of the surroundings.
_LEAST_OVER_TEXTURE = 4.0
_SURROUNDINGS_PX, _SURROUNDINGS_SCALES = 24.0, 20.0
_QUANTILE, _QUANTILE_TO_STD = 0.6, 1.0 / 0.8416


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
    least : (N,) array
        Strength that a line must have there to stand out from noise and texture.
    scale : float
        Smoothing with which they were found, px.
    """

    pixels: NDArray[np.int64]
    uv: Array
    direction: Array
    strength: Array
    least: Array
    scale: float

    def __len__(self) -> int:
        return len(self.pixels)

    def taken(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Ridges:
        """Some of the ridge pixels."""
        return Ridges(
            self.pixels[index],
            self.uv[index],
            self.direction[index],
            self.strength[index],
            self.least[index],
            self.scale,
        )


def ridges(light: LineLight, least_strength: float) -> Ridges:
    """Ridge pixels at the scale at which the picture's brightest lines answer most.

    C. Steger, "An unbiased detector of curvilinear structures", IEEE PAMI 20(2), 1998:
    a pixel lies on a line where the first derivative across it vanishes inside the pixel and
    the second is strongly negative.

    Parameters
    ----------
    light : LineLight
    least_strength : float
        Amplitude of the faintest line of interest, grey levels.
    """
    brightest = max(light.picture.shape) // 4
    found = [ridges_at(light.picture, scale, least_strength) for scale in SCALES]
    found = [one.taken(light.wants(one.pixels)) for one in found]
    return max(found, key=lambda one: _evidence(one, brightest))


def _evidence(found: Ridges, brightest: int) -> float:
    """Sum of the brightest strengths, less what noise and texture add to their squares.

    Without that the narrowest smoothing, whose answers scatter most, would win in noise.
    """
    beyond = np.sqrt(np.maximum(found.strength**2 - found.least**2, 0.0))
    return float(np.sum(np.sort(beyond)[-brightest:]))


def ridges_at(picture: Picture, scale: float, least_strength: float) -> Ridges:
    """Ridge pixels at one smoothing `scale` in px; see `ridges`."""
    smooth = _smooth(picture, scale)
    to_strength = _to_strength(scale)
    answer = _answer(smooth, scale)
    rows, columns = np.nonzero(answer[1:-1, 1:-1] >= (1.0 - _CURVATURE_RATIO) * least_strength)
    rows, columns = rows + 1, columns + 1
    texture = _texture(answer, scale, rows, columns)
    least = np.maximum(_LEAST_OVER_TEXTURE * texture, least_strength)
    plausible = answer[rows, columns] >= (1.0 - _CURVATURE_RATIO) * least
    rows, columns, least = rows[plausible], columns[plausible], least[plausible]
    gradient, hessian = _derivatives(smooth, rows, columns)
    across, along, curvature, other = _principal(hessian)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -np.sum(gradient * across, axis=-1) / curvature
        offset = distance[:, None] * across
        on_ridge = (np.abs(offset) <= _REACH_PX).all(axis=-1)
    strength = -curvature * to_strength
    on_ridge &= (strength >= least) & (np.abs(other) <= _CURVATURE_RATIO * -curvature)
    on_ridge[on_ridge] = _falls_on_both_sides(
        smooth, rows[on_ridge], columns[on_ridge], across[on_ridge], strength[on_ridge], scale
    )
    pixels = np.stack([columns, rows], axis=-1)[on_ridge]
    return Ridges(
        pixels,
        pixels + offset[on_ridge],
        along[on_ridge],
        strength[on_ridge],
        least[on_ridge],
        scale,
    )


def ridge_answer(picture: Picture, scale: float) -> Picture:
    """Strength ``(H, W)`` of a line of any direction that would answer so at each pixel."""
    return _answer(_smooth(picture, scale), scale)


def _smooth(picture: Picture, scale: float) -> Picture:
    blurred = cv2.GaussianBlur(picture, (0, 0), scale, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(blurred, np.float32)


def _to_strength(scale: float) -> float:
    """A line of standard deviation `scale` and amplitude A has the second derivative
    A / (2 sqrt(2) scale²) across it after smoothing."""
    return 2.0 * np.sqrt(2.0) * scale**2


def _answer(smooth: Picture, scale: float) -> Picture:
    curvature = np.asarray(cv2.Laplacian(smooth, cv2.CV_32F, ksize=1), np.float32)
    return curvature * -_to_strength(scale)


def _falls_on_both_sides(
    smooth: Picture,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    across: Array,
    strength: Array,
    scale: float,
) -> NDArray[np.bool_]:
    """Whether the light falls on both sides of pixels ``(N,)``.

    On the shoulder of a step, too, the first derivative is small and the second negative.
    """
    height, width = smooth.shape
    falls = np.ones(len(rows), dtype=bool)
    for side in (-_SIDE_SCALES * scale, _SIDE_SCALES * scale):
        beside_columns = np.clip(np.rint(columns + side * across[:, 0]), 0, width - 1)
        beside_rows = np.clip(np.rint(rows + side * across[:, 1]), 0, height - 1)
        beside = smooth[beside_rows.astype(np.int64), beside_columns.astype(np.int64)]
        falls &= smooth[rows, columns] - beside >= _LEAST_FALL * strength
    return falls


def _texture(
    answer: Picture, scale: float, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> Array:
    """Typical answer in the surroundings of pixels ``(N,)``, as a standard deviation.

    A line fills a small part of its surroundings; texture, compression noise and the squares of
    a board fill all of it, and a line must stand out from them.
    """
    height, width = answer.shape
    side = int(np.ceil(_SURROUNDINGS_SCALES * scale + _SURROUNDINGS_PX))
    tall, wide = min(side, height), min(side, width)
    down, right = height // tall, width // wide
    # Whole blocks only: the rest beside the last ones tells nothing new.
    blocks = answer[: down * tall, : right * wide].reshape(down, tall, right, wide)
    sparse = np.abs(np.swapaxes(blocks[:, ::3, :, ::3], 1, 2)).reshape(down, right, -1)
    rank = int(_QUANTILE * sparse.shape[-1])
    typical = np.partition(sparse, rank, axis=-1)[..., rank] * _QUANTILE_TO_STD
    # A line may fill much of one block, so the block's neighbours are asked as well.
    smooth = median_filter(typical, size=3, mode="nearest")
    return smooth[np.minimum(rows // tall, down - 1), np.minimum(columns // wide, right - 1)]


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
