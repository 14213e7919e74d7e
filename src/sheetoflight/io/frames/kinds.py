"""The kinds of files that hold frames, by their endings."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

from sheetoflight.io.frames import hdf5_stack, video_times
from sheetoflight.io.frames.frame import Stack
from sheetoflight.io.frames.hdf5_stack import open_hdf5
from sheetoflight.io.frames.npy_stack import open_npy
from sheetoflight.io.frames.opened import Opener
from sheetoflight.io.frames.tiff_stack import open_tiff
from sheetoflight.io.frames.video import open_video

_OPENERS: dict[str, Opener] = {
    ".npy": open_npy,
    **dict.fromkeys(hdf5_stack.ENDINGS, open_hdf5),
    **dict.fromkeys(video_times.ENDINGS, open_video),
}

STACK_ENDINGS = frozenset(_OPENERS)
"""Endings, in lower case, of files that hold nothing but stacks; a TIFF may be a picture too."""


def opened(path: Path, inside: str, max_pixels: int) -> AbstractContextManager[Stack]:
    """Open a stack or a video; whatever has none of their endings, as TIFF.

    Parameters
    ----------
    path : Path
    inside : str
        Path of the data set in an HDF5 file.
    max_pixels : int
        Refuse frames with more pixels than this.

    Raises
    ------
    FileError, InputError
        On entering, if it cannot be opened.
    """
    return _OPENERS.get(path.suffix.lower(), open_tiff)(path, inside, max_pixels)
