"""A picture as the detectors see it: grey, floating point, with its noise known."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError

Picture = NDArray[np.float32]

_WHITE = 255.0
_SMALLEST_SIDE = 16
# Mean of the middle 40 % of |x| for a standard normal x.
_MIDDLE_ABSOLUTE_NORMAL = 0.6857


@dataclass(frozen=True)
class GreyPicture:
    """A grey picture scaled so that its brightest value is at most 255.

    Parameters
    ----------
    values : (H, W) float32 array
    noise : float
        Standard deviation of a pixel's random error, in the units of `values`.
    """

    values: Picture
    noise: float


def grey_picture(image: np.ndarray) -> GreyPicture:
    """Grey values and noise of a picture.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        uint8, uint16 or floating point; colour is averaged with OpenCV's weights (BGR order).
        Eight-bit values are kept; others are scaled so that the brightest becomes 255.

    Raises
    ------
    InputError
        If the array is no picture, or holds values that are not finite.
    """
    image = np.asarray(image)
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3, 4)):
        raise InputError(
            f"the picture has shape {image.shape}", "give an array (H, W) or (H, W, 3)"
        )
    if min(image.shape[:2]) < _SMALLEST_SIDE:
        raise InputError(
            f"the picture is {image.shape[1]} x {image.shape[0]} px",
            f"give one of at least {_SMALLEST_SIDE} px a side",
        )
    if image.dtype.kind not in "uif":
        raise InputError(
            f"the picture holds {image.dtype} values", "give uint8, uint16 or floating point"
        )
    values = image.astype(np.float32)
    if not np.isfinite(values).all():
        raise InputError("the picture holds values that are not finite", "give finite grey values")
    if image.ndim == 3:
        values = values[..., 0] if image.shape[2] == 1 else _grey(values[..., :3])
    peak = float(values.max())
    if image.dtype != np.uint8 and peak > 0:
        values = values * np.float32(_WHITE / peak)
    quantum = _quantum(image, peak)
    noise = max(_noise(values), quantum / np.sqrt(12.0))
    return GreyPicture(np.ascontiguousarray(values), noise)


def _grey(values: Picture) -> Picture:
    grey = cv2.cvtColor(np.ascontiguousarray(values), cv2.COLOR_BGR2GRAY)
    return np.asarray(grey, dtype=np.float32)


def _quantum(image: np.ndarray, peak: float) -> float:
    """The step between neighbouring grey values, in scaled units."""
    if image.dtype == np.uint8:
        return 1.0
    if image.dtype.kind in "ui" and peak > 0:
        return _WHITE / peak
    return 0.0


def _noise(values: Picture) -> float:
    """Standard deviation of the pixels' noise.

    The mask is the difference of two Laplacians, blind to constant, sloping and evenly curved
    intensity (Immerkær, "Fast noise variance estimation", Computer Vision and Image
    Understanding 64(2), 1996). Of its absolute responses the middle 40 % count: the edges are
    left out, and whole grey values do not make the estimate jump as they would the median.
    """
    mask = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).astype(np.float32) / 6.0
    response = np.abs(cv2.filter2D(values, cv2.CV_32F, mask)[1:-1:2, 1:-1:2]).ravel()
    low, high = int(0.3 * len(response)), int(0.7 * len(response))
    middle = np.partition(response, (low, high))[low : high + 1]
    return float(middle.mean(dtype=float)) / _MIDDLE_ABSOLUTE_NORMAL
