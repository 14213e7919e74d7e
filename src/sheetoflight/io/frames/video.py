"""Videos, decoded onwards from the first frame, so that the number of every frame is exact.

Eight bits in blue, green, red, whatever the video has. Damage that a decoder papers over leaves no
trace that could be found.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from sheetoflight.errors import FileError
from sheetoflight.io.frames.opened import refuse_no_file, refusing
from sheetoflight.io.frames.video_times import (
    ENDINGS,
    Times,
    opened_capture,
    refuse_other_formats,
    times_of,
)
from sheetoflight.io.picture_decoding import Picture, silent_decoder
from sheetoflight.io.quoting import file_name

__all__ = ["ENDINGS", "Video", "open_video"]

_AGAIN = "copy or record it again"
_MOST_LEFT_OPEN = 2
_left_open: list[Video] = []
"""Where the next block of frames most likely goes on; two, for a pair."""


class Video:
    """An open video.

    A jump to a frame lands on another one in many files, so there is none: the frames on the
    way are decoded too, and numbered by the times that the file gives them.

    Parameters
    ----------
    path : Path
    max_pixels : int
        Refuse frames with more pixels than this.
    """

    def __init__(self, path: Path, max_pixels: int) -> None:
        self._path, self._max_pixels = path, max_pixels
        self._times: Times = times_of(path)
        self._start()
        self._refuse_claims()

    @property
    def frames(self) -> int:
        """Those that have data, and one more where the file ends before it says."""
        return len(self._times) + (self._times.missing > 0)

    @property
    def under_way(self) -> bool:
        """Whether some frames have been decoded and others not."""
        return 0 <= self._at < len(self._times) - 1

    def picture(self, index: int) -> Picture:
        """One frame; quick where it lies ahead of the last one asked for."""
        if index >= len(self._times):
            raise FileError(
                f"{file_name(self._path)} ends early: {self._times.missing} of its "
                f"{self._times.stated} frames are missing",
                _AGAIN,
            )
        if index <= self._before:
            self._start()
        while self._at < index:
            self._before, self._at = self._at, self._next()
        if self._at == index:
            with silent_decoder():
                found, picture = self._capture.retrieve()
            if found and picture.ndim == 3 and picture.dtype == np.uint8:
                return np.asarray(picture, np.uint8)
        raise FileError(
            f"{file_name(self._path)}[{index}] is damaged: it cannot be decoded", _AGAIN
        )

    def serves(self, path: Path, max_pixels: int) -> bool:
        """Whether this is that file, unchanged since it was opened."""
        same = self._path == path and self._max_pixels == max_pixels
        return same and times_of(path) is self._times

    def _start(self) -> None:
        """Before the first frame; `_at` is the last one decoded, `_before` the one before it."""
        self._capture = opened_capture(self._path)
        self._before = self._at = -1

    def _next(self) -> int:
        """The number of the next frame that can be decoded; past the last at the end."""
        with silent_decoder():
            for _ in range(self._at, len(self._times)):  # a failure uses up one frame or more
                if self._capture.grab():
                    time = self._capture.get(cv2.CAP_PROP_POS_MSEC)
                    return max(self._times.number(time, self._at + 1), self._at + 1)
        return len(self._times)

    def _refuse_claims(self) -> None:
        width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if width * height > self._max_pixels:
            raise FileError(
                f"{file_name(self._path)} claims frames of {width} × {height} px, more than "
                f"{self._max_pixels} in all",
                "give a smaller video",
            )


@contextmanager
def open_video(path: Path, _inside: str, max_pixels: int) -> Iterator[Video]:
    """Open a video; one that was left between two frames is taken up there.

    Parameters
    ----------
    path : Path
    max_pixels : int
        Refuse frames with more pixels than this.

    Raises
    ------
    FileError
        If the file is no AVI, MP4, MOV or MKV that can be decoded, or claims too large frames.
    """
    refuse_no_file(path)
    with refusing(path, cv2.error, UnicodeError):
        refuse_other_formats(path)
        fitting = [video for video in _left_open if video.serves(path, max_pixels)]
        if fitting:
            _left_open.remove(fitting[-1])
        video = fitting[-1] if fitting else Video(path, max_pixels)
    yield video
    if video.under_way:
        _left_open.append(video)
        del _left_open[:-_MOST_LEFT_OPEN]
