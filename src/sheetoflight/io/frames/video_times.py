"""When a video's frames are shown, read from its packets without decoding any."""

from __future__ import annotations

import os
from array import array
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from sheetoflight.errors import FileError
from sheetoflight.io.picture_decoding import silent_decoder
from sheetoflight.io.quoting import file_name

# Its words on damaged files name no file; read by the library when it opens its first video.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

ENDINGS = frozenset((".avi", ".mkv", ".mov", ".mp4"))

_MATROSKA = b"\x1a\x45\xdf\xa3"
_ATOMS = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot")
_PACKETS_ALONE = -1


@dataclass(frozen=True, eq=False)
class Times:
    """What the packets of a video tell.

    Parameters
    ----------
    times : array of float
        When each frame is shown, in ms, in order.
    step : float
        The least time between two frames; 0 where the file gives no times of their own.
    stated : int
        How many frames the header states.
    estimated : bool
        Whether that number follows from a duration, which tells it to within one frame.
    """

    times: array[float]
    step: float
    stated: int
    estimated: bool

    def __len__(self) -> int:
        return len(self.times)

    @property
    def missing(self) -> int:
        """How many frames the file lacks of those it states."""
        lacking = self.stated - len(self.times)
        return lacking if lacking > self.estimated else 0

    def number(self, time: float, expected: int) -> int:
        """The frame shown at a time in ms, or the one expected where times tell nothing."""
        return bisect_left(self.times, time - self.step / 4) if self.step > 0 else expected


def times_of(path: Path) -> Times:
    """The times of a video's frames; remembered while the file stays as it is.

    Raises
    ------
    FileError
        If the video cannot be opened, or holds no frame.
    """
    state = path.stat()
    return _times_of(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=4)
def _times_of(path: Path, _size: int, _changed: int) -> Times:
    capture = opened_capture(path)
    stated = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    capture.set(cv2.CAP_PROP_FORMAT, _PACKETS_ALONE)
    found = array("d")
    with silent_decoder():
        while capture.grab():
            found.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    if not found:
        raise FileError(f"{file_name(path)} holds no frame", "record it again")
    times = array("d", sorted(found))  # packets come in the order of decoding
    step = float(np.diff(times).min()) if len(times) > 1 else 0.0
    return Times(times, step, int(max(stated, 0)), _starts_with(path)[:4] == _MATROSKA)


def opened_capture(path: Path) -> cv2.VideoCapture:
    """A video opened at its first frame, its pictures not turned by what it says of the camera.

    Raises
    ------
    FileError
        If it cannot be opened.
    """
    with silent_decoder():
        # an absolute path is a file's; "concat:…" would be a recipe
        capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise FileError(
            f"{file_name(path)} is damaged or holds no video that can be decoded",
            "copy or record it again, or convert it to FFV1 in AVI",
        )
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return capture


def refuse_other_formats(path: Path) -> None:
    """Refuse what begins like none of the formats: playlists above all, which name other files.

    Raises
    ------
    FileError
        If it is no AVI, MP4, MOV or MKV.
    """
    start = _starts_with(path)
    avi = start[:4] == b"RIFF" and start[8:11] == b"AVI"
    if not (avi or start[:4] == _MATROSKA or start[4:8] in _ATOMS):
        raise FileError(
            f"{file_name(path)} is damaged or no AVI, MP4, MOV or MKV video",
            "copy or record it again, or convert it to one of these",
        )


def _starts_with(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(12)
