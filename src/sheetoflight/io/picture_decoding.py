"""Samples of picture files: decoded by tifffile and OpenCV, put in one order of colours, checked.

What reads single pictures and what reads pages of a stack share all of this.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray

from sheetoflight.errors import FileError
from sheetoflight.io.picture_checks import is_tiff, silent, tiff_page

MAX_PIXELS = 200_000_000
"""More than any camera of today; what claims more is damaged or meant to do harm."""

# Formats whose header is not read here are held to the same limit by the decoder itself, which
# asks for it when it is loaded; a limit that the user has set stands.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))

import cv2  # noqa: E402 – see above

Picture = NDArray[np.uint8] | NDArray[np.uint16]

DECODING = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION
"""How OpenCV reads: the depth and colours that are there, not turned."""

_DECODER_LOG: Any = getattr(cv2.utils, "logging", cv2)  # OpenCV 5 and 4 keep it in two places
_SILENT = 0
_UNPACKED_BY_TIFFFILE = (8, 32946)
"""Both numbers of Deflate. Its streams end in a checksum, which OpenCV ignores: it would give
black where they are damaged."""


@contextmanager
def silent_decoder() -> Iterator[None]:
    """OpenCV's own words on damaged files kept from standard error: they name no file."""
    level = _DECODER_LOG.getLogLevel()
    _DECODER_LOG.setLogLevel(_SILENT)
    try:
        yield
    finally:
        _DECODER_LOG.setLogLevel(level)


def decoded_page(
    page: tifffile.TiffPage, by_opencv: Callable[[], NDArray[Any] | None]
) -> NDArray[Any] | None:
    """A TIFF's page by tifffile where it can, else by OpenCV; None where neither can.

    Parameters
    ----------
    page : tifffile.TiffPage
    by_opencv : callable
        The same page, decoded by OpenCV. Asked for other kinds of colour, and for packings that
        tifffile leaves to others; of these, LZW and PackBits have no checksum, so that damage
        inside a strip may leave no trace.

    Returns
    -------
    (height, width) or (height, width, channels) array, or None
        Grey, or blue, green, red.
    """
    try:
        with silent("tifffile"):
            samples = blue_green_red(page, page.asarray())
    except Exception:  # of a damaged file tifffile lets out errors of any type
        if page.compression in _UNPACKED_BY_TIFFFILE:
            return None
        samples = None
    return _in_silence(by_opencv) if samples is None else samples


def decoded_picture(data: bytes) -> NDArray[Any] | None:
    """A picture of any format, its claims already read; None where it cannot be decoded."""

    def by_opencv() -> NDArray[Any] | None:
        return cv2.imdecode(np.frombuffer(data, np.uint8), DECODING)

    if not is_tiff(data):
        return _in_silence(by_opencv)
    with tiff_page(data) as (page, _):
        return decoded_page(page, by_opencv)


def as_png(picture: NDArray[Any]) -> bytes:
    """A picture as the content of a PNG file."""
    return cv2.imencode(".png", picture)[1].tobytes()


def _in_silence(decode: Callable[[], NDArray[Any] | None]) -> NDArray[Any] | None:
    try:
        with silent_decoder():
            return decode()
    except (cv2.error, UnicodeError):
        return None


def blue_green_red(page: tifffile.TiffPage, samples: NDArray[Any]) -> NDArray[Any] | None:
    """Grey, or blue, green, red; None for other kinds of colour, which OpenCV knows."""
    kind = page.photometric
    if kind == tifffile.PHOTOMETRIC.RGB and samples.ndim == 3:
        colours_last = samples if page.planarconfig == 1 else np.moveaxis(samples, 0, -1)
        return np.ascontiguousarray(colours_last[..., 2::-1])
    if kind == tifffile.PHOTOMETRIC.MINISWHITE and samples.dtype.kind == "u":
        return np.iinfo(samples.dtype).max - samples
    return samples if kind == tifffile.PHOTOMETRIC.MINISBLACK else None


def is_picture(array: NDArray[Any]) -> bool:
    """Whether an array is grey or colour of 8 or 16 bit, and not empty."""
    grey_or_colour = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)
    return array.dtype in (np.uint8, np.uint16) and grey_or_colour and array.size > 0


def refuse_other_samples(name: str, samples: NDArray[Any]) -> None:
    """Refuse what is no picture of 8 or 16 bit.

    Raises
    ------
    FileError
    """
    if not is_picture(samples):
        raise FileError(
            f"{name} holds {samples.dtype} samples in shape {samples.shape}, expected 8 or 16 bit "
            "in grey or colour",
            "save it as 8- or 16-bit PNG or TIFF",
        )


def refuse_many_pixels(name: str, width: int, height: int, max_pixels: int) -> None:
    """Refuse what has more pixels than are read.

    Raises
    ------
    FileError
    """
    if width * height > max_pixels:
        raise FileError(
            f"{name} has {width} × {height} px, more than {max_pixels} in all",
            "give a smaller picture",
        )
