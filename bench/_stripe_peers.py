"""What people find a laser line's centres with: OpenCV scripts, scikit-image, ridge-detector.

Each is told the line's true width and height and the dark level, as one who tunes it to a set-up
would find them, and takes its smoothing and its threshold from these.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array

Picture = NDArray[np.uint8]
_THRESHOLD = 0.3  # of the line's height
_BAR = float(np.sqrt(12.0))  # width of the bar that has a standard deviation of 1


@dataclass(frozen=True)
class Told:
    """What the peers are told of a line: its `width` (standard deviation, px), its `height` over
    the dark, and the `dark` itself, grey levels."""

    width: float
    height: float
    dark: float

    @property
    def threshold(self) -> float:
        """Grey level that tells the line from the dark."""
        return self.dark + _THRESHOLD * self.height


def brightest(picture: Picture, told: Told) -> Array:
    """Brightest pixel of each column of the blurred picture."""
    blurred = cv2.GaussianBlur(picture, (5, 5), 0)
    return _where_lit(picture, told, blurred.argmax(axis=0))


def window_centroid(picture: Picture, told: Told) -> Array:
    """Centre of gravity of the grey levels around each column's brightest pixel."""
    return _window_centroid(picture, told, 0.0)


def window_centroid_less_dark(picture: Picture, told: Told) -> Array:
    """The same, the dark level taken off first."""
    return _window_centroid(picture, told, told.dark)


def _window_centroid(picture: Picture, told: Told, dark: float) -> Array:
    peak = cv2.GaussianBlur(picture, (5, 5), 0).argmax(axis=0)
    half = int(np.ceil(3.0 * told.width))
    rows = np.clip(peak + np.arange(-half, half + 1)[:, None], 0, len(picture) - 1)
    grey = np.maximum(np.take_along_axis(picture, rows, axis=0) - dark, 0.0)
    total = np.maximum(grey.sum(axis=0), np.finfo(float).tiny)
    return _where_lit(picture, told, (rows * grey).sum(axis=0) / total)


def column_centroid(picture: Picture, told: Told) -> Array:
    """Centre of gravity of all of a column that is brighter than a threshold."""
    _, lit = cv2.threshold(picture, told.threshold, 255.0, cv2.THRESH_TOZERO)
    rows = np.stack([np.ones(len(picture)), np.arange(len(picture))]).astype(np.float32)
    weight, moment = cv2.gemm(rows, lit.astype(np.float32), 1.0, np.empty(0), 0.0).astype(float)
    u = np.flatnonzero(weight)
    return np.stack([u.astype(float), moment[u] / weight[u]], axis=-1)


def textbook_steger(picture: Picture, told: Told) -> Array:
    """Ridge points of the blurred picture: Steger 1998, equations 18 to 23, step by step.

    The blur is as wide as the line, the least that Steger's σ ≥ w/√3 allows for a bar of half
    width w = √3 standard deviations. A ridge bends by part of A/(√8 w²), the line's own bend.
    """
    blurred = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), told.width)
    first, second = np.array([[-0.5, 0.0, 0.5]]), np.array([[1.0, -2.0, 1.0]])
    kernels = (first, first.T, second, first.T @ first, second.T)
    slopes = [cv2.filter2D(blurred, cv2.CV_32F, kernel) for kernel in kernels]
    v, u = np.nonzero(blurred > told.threshold)
    x, y, xx, xy, yy = (slope[v, u].astype(float) for slope in slopes)
    values, vectors = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2))
    nx, ny = vectors[:, 0, 0], vectors[:, 1, 0]
    least = _THRESHOLD * told.height / (np.sqrt(8.0) * told.width**2)
    step = -(x * nx + y * ny) / np.minimum(values[:, 0], -least)
    ridge = (values[:, 0] <= -least) & (np.abs(step * nx) <= 0.5) & (np.abs(step * ny) <= 0.5)
    return np.stack([u + step * nx, v + step * ny], axis=-1)[ridge]


def skeleton(picture: Picture, told: Told) -> Array:
    """Skeleton of what is brighter than Otsu's threshold."""
    del told  # Otsu's threshold asks for nothing
    lit = picture > import_module("skimage.filters").threshold_otsu(picture)
    v, u = np.nonzero(import_module("skimage.morphology").skeletonize(lit))
    return np.stack([u, v], axis=-1).astype(float)


def meijering_ridge(picture: Picture, told: Told) -> Array:
    """Greatest response of Meijering's filter in each column."""
    return _where_lit(picture, told, _response("meijering", picture, told).argmax(axis=0))


def frangi_ridge(picture: Picture, told: Told) -> Array:
    """Greatest response of Frangi's filter in each column."""
    return _where_lit(picture, told, _response("frangi", picture, told).argmax(axis=0))


def sato_ridge(picture: Picture, told: Told) -> Array:
    """Greatest response of Sato's filter in each column."""
    return _where_lit(picture, told, _response("sato", picture, told).argmax(axis=0))


def sato_parabola(picture: Picture, told: Told) -> Array:
    """Top of the parabola through the three responses of Sato's filter about each greatest one."""
    response = _response("sato", picture, told)
    peak = np.clip(response.argmax(axis=0), 1, len(picture) - 2)
    below, top, above = (response[peak + i, np.arange(len(peak))] for i in (-1, 0, 1))
    bend = np.minimum(below - 2.0 * top + above, -np.finfo(float).tiny)
    return _where_lit(picture, told, peak + np.clip(0.5 * (below - above) / bend, -0.5, 0.5))


def _response(name: str, picture: Picture, told: Told) -> Array:
    ridges = getattr(import_module("skimage.filters"), name)
    return ridges(picture, sigmas=[told.width], black_ridges=False)


def ridge_detector(picture: Picture, told: Told) -> Array:
    """Lines that the package ridge-detector links, at one scale."""
    detector = import_module("ridge_detector").RidgeDetector(
        line_widths=[_BAR * told.width],
        low_contrast=0.5 * told.height,
        high_contrast=told.height,
        dark_line=False,
        estimate_width=False,
    )
    detector.detect_lines(picture)
    lines = [np.stack([line.col, line.row], axis=-1) for line in detector.contours]
    return np.concatenate([np.empty((0, 2)), *lines])


def _where_lit(picture: Picture, told: Told, v: NDArray[Any]) -> Array:
    """Points at the rows `v` of all columns, but for columns without light over a threshold."""
    u = np.flatnonzero(picture.max(axis=0) > told.threshold)
    return np.stack([u, v[u]], axis=-1).astype(float)
