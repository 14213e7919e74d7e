"""The binary picture of the laser line: the paper's Fig. 7."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.colour import laser_light
from sheetoflight.imaging.stripe.light import local_background
from sheetoflight.imaging.stripe.ridges import ridges

_LEAST_SNR = 5.0
_PART_OF_LINE = 0.25
_LEAST_PIXELS = 12


def binary_line(image_on: NDArray[Any], image_off: NDArray[Any] | None = None) -> NDArray[np.bool_]:
    """Pixels lit by the laser line.

    A pixel counts where its light exceeds five standard deviations of the noise and a quarter of
    the line's typical height, and where at least twelve such pixels hang together.

    Parameters
    ----------
    image_on, image_off
        As for `sheetoflight.imaging.stripe.pieces.line_pieces`.

    Returns
    -------
    (H, W) bool array

    Raises
    ------
    InputError
        If a picture is no picture, or the two do not match.
    """
    light = laser_light(image_on, image_off)
    least = _LEAST_SNR * light.noise_std
    if min(light.picture.shape) < 8 or least == 0.0:
        return np.zeros(light.picture.shape, dtype=bool)
    strength = ridges(light, least).strength
    if len(strength) == 0:
        return np.zeros(light.picture.shape, dtype=bool)
    excess = light.picture if light.differenced else light.picture - local_background(light.picture)
    lit = excess > max(least, _PART_OF_LINE * float(np.median(strength)))
    return _without_specks(lit)


def _without_specks(lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(
        lit.astype(np.uint8), connectivity=8
    )
    large = statistics[:, cv2.CC_STAT_AREA] >= _LEAST_PIXELS
    large[0] = False
    return large[np.asarray(labels, np.int64)]
