"""Frames read, one file after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import groupby
from pathlib import Path

from sheetoflight.errors import SheetOfLightError
from sheetoflight.io.frames.frame import DamagedFrame, Frame, Pictures, Stack
from sheetoflight.io.frames.kinds import STACK_ENDINGS, opened
from sheetoflight.io.frames.opened import refusing
from sheetoflight.io.pictures import MAX_PIXELS, read_picture

_Stacks = tuple[Stack | None, Stack | None]


def read_frame(frame: Frame, max_pixels: int = MAX_PIXELS) -> Pictures:
    """One frame; of a video, those before it are decoded on the way.

    Parameters
    ----------
    frame : Frame
    max_pixels : int
        Refuse pictures with more pixels than this.

    Returns
    -------
    on, off : (height, width) or (height, width, 3) array of uint8 or uint16
        As `read_picture` gives them, off None where there is no partner. Colour in ``.npy`` and
        HDF5 is taken to be stored as red, green, blue, and comes as blue, green, red. Videos
        come in eight bits and colour.

    Raises
    ------
    FileError, InputError
        If the frame cannot be read.
    """
    with ExitStack() as files:
        return _pictures(frame, _opened(frame, files, max_pixels), max_pixels)


def read_frames(
    frames: Iterable[Frame], max_pixels: int = MAX_PIXELS
) -> Iterator[Pictures | DamagedFrame]:
    """Frames in order, a file opened once for all that follow one another in it.

    Parameters
    ----------
    frames : iterable of Frame
    max_pixels : int
        Refuse pictures with more pixels than this.

    Yields
    ------
    (on, off) or DamagedFrame
        For every frame, its pictures as `read_frame` gives them, or why there are none.
    """
    for _, group in groupby(frames, _files):
        yield from _of_one_file(group, max_pixels)


def _files(frame: Frame) -> tuple[Path, Path | None, str]:
    return frame.path, frame.laser_off, frame.inside


def _of_one_file(frames: Iterator[Frame], max_pixels: int) -> Iterator[Pictures | DamagedFrame]:
    with ExitStack() as files:
        stacks: _Stacks | None = None
        for frame in frames:
            try:
                stacks = stacks or _opened(frame, files, max_pixels)
                found = _pictures(frame, stacks, max_pixels)
            except SheetOfLightError as error:
                found = DamagedFrame(frame, str(error))
            yield found


def _opened(frame: Frame, files: ExitStack, max_pixels: int) -> _Stacks:
    """The files of a frame, open; None in place of single pictures."""
    if frame.index is None and frame.path.suffix.lower() not in STACK_ENDINGS:
        return None, None
    with ExitStack() as both:
        on = both.enter_context(opened(frame.path, frame.inside, max_pixels))
        off = frame.laser_off and both.enter_context(opened(frame.laser_off, "", max_pixels))
        files.enter_context(both.pop_all())  # had the second failed, the first were closed
    return on, off or None


def _pictures(frame: Frame, stacks: _Stacks, max_pixels: int) -> Pictures:
    on, off = stacks
    index = frame.index or 0
    if on is None:
        lit = read_picture(frame.path, max_pixels)
        return lit, None if frame.laser_off is None else read_picture(frame.laser_off, max_pixels)
    with refusing(frame.path):
        return on.picture(index), None if off is None else off.picture(index)
