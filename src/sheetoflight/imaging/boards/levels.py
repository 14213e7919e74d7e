"""The picture in the forms that OpenCV's detectors are shown."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.markers.grey import Picture
from sheetoflight.imaging.markers.pyramid import pyramid

EightBit = NDArray[np.uint8]

_LARGEST_SIDE = 1600
_SMALLEST_SIDE = 200
_MOST_LEVELS = 8
_WHITE, _BRIGHT_SHARE, _GAMMA = 255.0, 99.0, 0.5


def eight_bit(values: Picture) -> EightBit:
    """Grey values as whole numbers from 0 to 255."""
    return np.clip(np.rint(values), 0.0, _WHITE).astype(np.uint8)


def brightened(values: Picture) -> EightBit:
    """The picture with its dark parts lifted; the brightest hundredth, where a laser line may
    be, is left out of account."""
    white = max(float(np.percentile(values[::4, ::4], _BRIGHT_SHARE)), 1.0)
    return eight_bit((_WHITE * np.clip(values / white, 0.0, 1.0) ** _GAMMA).astype(np.float32))


def at_working_size(values: Picture) -> tuple[Picture, float]:
    """The picture, reduced where it is large, and the width of a reduced pixel in px.

    Pixel (i, j) of the reduced picture lies at (width · i, width · j).
    """
    levels = pyramid(values, _MOST_LEVELS)
    level = next((n for n, v in enumerate(levels) if max(v.shape) <= _LARGEST_SIDE), -1)
    level = level % len(levels)
    return levels[level], 2.0**level


def at_quick_size(values: Picture) -> tuple[EightBit, float]:
    """The picture at half its working size where that leaves enough of it, and the width of its
    pixels in px."""
    work, size = at_working_size(values)
    if min(work.shape) < 2 * _SMALLEST_SIDE:
        return eight_bit(work), size
    return eight_bit(np.asarray(cv2.pyrDown(work), dtype=np.float32)), 2.0 * size


def shown(values: Picture) -> Iterator[tuple[EightBit, float]]:
    """Forms of a picture in the order in which they are worth a look, with their pixels' width.

    As it is; at half the size, where noise and blur are less; with its dark parts lifted; and
    last at full size, where it is large and the board in it may be small.
    """
    work, size = at_working_size(values)
    yield eight_bit(work), size
    half = np.asarray(cv2.pyrDown(work), dtype=np.float32)
    large_enough = min(half.shape) >= _SMALLEST_SIDE
    if large_enough:
        yield eight_bit(half), 2.0 * size
    yield (brightened(half), 2.0 * size) if large_enough else (brightened(work), size)
    if size > 1.0:
        yield eight_bit(values), 1.0
