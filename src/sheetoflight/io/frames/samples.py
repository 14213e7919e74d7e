"""How the samples of a stack are laid out as frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import FileError
from sheetoflight.io.pictures import Picture

_CHANNELS = (1, 3, 4)
_MOST_FRAMES = 2**40
"""A thousand years of video: what claims more frames is damaged or meant to do harm."""


@dataclass(frozen=True)
class Layout:
    """A stack's frames.

    Parameters
    ----------
    frames : int or None
        How many there are; None where the array is a single picture.
    shape : tuple of int
        Of one frame: (height, width) or (height, width, channels).
    dtype : dtype
        uint8 or uint16 in the file's byte order.
    """

    frames: int | None
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def frame_bytes(self) -> int:
        """Bytes of one frame."""
        return int(np.prod(self.shape, dtype=object)) * self.dtype.itemsize


def layout_of(name: str, shape: Sequence[int], dtype: np.dtype[Any], max_pixels: int) -> Layout:
    """What an array of this shape holds.

    A last axis of 1, 3 or 4 is taken for grey, red-green-blue, or that with transparency.

    Parameters
    ----------
    name : str
        Of the file, fit for a message.
    shape : (height, width), (height, width, channels), or either after a number of frames
    dtype : dtype
    max_pixels : int
        Refuse frames with more pixels than this.

    Raises
    ------
    FileError
        If the samples are neither 8 nor 16 bit, the shape is no stack's, or claims too much.
    """
    if dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        raise FileError(
            f"{name} holds {dtype} samples, expected 8 or 16 bit without sign",
            "save it as uint8 or uint16, the samples scaled by one factor for all frames",
        )
    axes = 3 if len(shape) > 2 and shape[-1] in _CHANNELS else 2
    if len(shape) not in (axes, axes + 1) or min(shape) < 1:
        raise FileError(
            f"{name} has shape {tuple(shape)}, expected (frames, height, width) or (frames, "
            "height, width, 3)",
            "arrange its axes so, with at least one frame",
        )
    frames = shape[0] if len(shape) > axes else None
    _refuse_too_much(name, frames or 1, shape[-axes], shape[1 - axes], max_pixels)
    return Layout(frames, tuple(shape[-axes:]), dtype)


def as_picture(samples: NDArray[Any]) -> Picture:
    """Samples as `read_picture` gives them: native byte order; blue, green, red.

    Parameters
    ----------
    samples : (height, width) or (height, width, channels) array
        Grey, or red, green, blue.
    """
    native = samples.astype(samples.dtype.newbyteorder("="), copy=False)
    if native.ndim == 2:
        return native
    if native.shape[2] == 1:
        return native[..., 0]
    return np.ascontiguousarray(native[..., 2::-1])


def _refuse_too_much(name: str, frames: int, height: int, width: int, max_pixels: int) -> None:
    if height * width > max_pixels:
        raise FileError(
            f"{name} claims frames of {width} × {height} px, more than {max_pixels} in all",
            "give smaller pictures, or write the file again if it is damaged",
        )
    if frames > _MOST_FRAMES:
        raise FileError(f"{name} claims {frames} frames", "write the file again")
