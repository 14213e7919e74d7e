"""Pictures as PNG data URIs, small enough for one page."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import cv2
import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.report.contents import MeasuredPicture

_WIDTHS = (1000, 800, 640, 500, 400, 320)
_TOTAL_CHARACTERS = 2_800_000


def embedded(pictures: Sequence[MeasuredPicture]) -> list[tuple[str, str]]:
    """Data URIs of each picture and of its binary picture, "" where there is none.

    All are scaled to at most 1000 px width, and further down where the page would grow by
    more than three megabytes.
    """
    for width in _WIDTHS[:-1]:
        uris = _uris(pictures, width)
        if sum(len(grey) + len(binary) for grey, binary in uris) <= _TOTAL_CHARACTERS:
            return uris
    return _uris(pictures, _WIDTHS[-1])


def _uris(pictures: Sequence[MeasuredPicture], width: int) -> list[tuple[str, str]]:
    return [(_grey_uri(p.image, width), _binary_uri(p.binary, width)) for p in pictures]


def _grey_uri(image: np.ndarray, width: int) -> str:
    return _png_uri(_narrowed(_eight_bit(image), width))


def _binary_uri(binary: np.ndarray | None, width: int) -> str:
    if binary is None:
        return ""
    # Any lit pixel keeps its place lit: a thinned line would fade away in an average.
    lit = _narrowed(binary.astype(np.float32), width) > 0
    return _png_uri(lit.astype(np.uint8) * 255, (cv2.IMWRITE_PNG_BILEVEL, 1))


def _eight_bit(image: np.ndarray) -> np.ndarray:
    """16-bit pictures are shown with their brightest pixel white; 8-bit ones as they are."""
    if image.dtype == np.uint8:
        return image
    brightest = max(int(image.max(initial=0)), 1)
    return np.round(image * (255.0 / brightest)).astype(np.uint8)


def _narrowed(image: np.ndarray, width: int) -> np.ndarray:
    if image.shape[1] <= width:
        return image
    height = max(round(image.shape[0] * width / image.shape[1]), 1)
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)


def _png_uri(image: np.ndarray, options: tuple[int, ...] = ()) -> str:
    written, content = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9, *options])
    if not written:
        raise InputError(
            f"a picture of shape {image.shape} cannot be written as PNG", "give a larger picture"
        )
    return "data:image/png;base64," + base64.b64encode(content.tobytes()).decode("ascii")
