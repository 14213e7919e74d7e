"""The picture at half, quarter … size, and without narrow bright lines."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.imaging.markers.grey import Picture

_SMALLEST_SIDE = 24
_NARROW, _NEIGHBOURHOOD = 9, 31


def pyramid(values: Picture, levels: int) -> list[Picture]:
    """The picture and its reductions; pixel (i, j) of level n lies at (2ⁿ i, 2ⁿ j)."""
    reduced = [values]
    while len(reduced) < levels and min(reduced[-1].shape) >= 2 * _SMALLEST_SIDE:
        reduced.append(np.asarray(cv2.pyrDown(reduced[-1]), dtype=np.float32))
    return reduced


def opened(values: Picture) -> Picture:
    """The picture without what is bright and narrower than 9 px."""
    narrow = cv2.getStructuringElement(cv2.MORPH_RECT, (_NARROW, _NARROW))
    return np.asarray(cv2.morphologyEx(values, cv2.MORPH_OPEN, narrow), dtype=np.float32)


def held_down(values: Picture) -> Picture:
    """The picture with nothing brighter than the broad bright areas within 15 px.

    A laser line is brighter than the paper it falls on, but narrow. The brightest that remains
    in the neighbourhood after `opened` is the limit: paper stays, a line on it becomes as
    bright as the paper, and one on ink, which reflects little of it, does no harm.
    """
    wide = cv2.getStructuringElement(cv2.MORPH_RECT, (_NEIGHBOURHOOD, _NEIGHBOURHOOD))
    return np.minimum(values, cv2.dilate(opened(values), wide))
