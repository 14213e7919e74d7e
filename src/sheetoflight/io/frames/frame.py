"""Where one frame of a stream is, and what can be said of one that cannot be read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sheetoflight.io.pictures import Picture

Pictures = tuple[Picture, Picture | None]
"""The picture with the laser on, and the one with the laser off where there is one."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Where one picture, or pair of pictures, is. Small: any process can read it from this.

    Parameters
    ----------
    name : str
        Unique among the frames listed together: a picture's name, or ``stack.npy[17]``.
    path : Path
        The file; of a pair, the one with the laser on.
    index : int or None
        Which of the file's frames, from 0; None where the file is a single picture.
    laser_off : Path or None
        The partner with the laser off, of the same kind and at the same index.
    inside : str
        Path of the data set within an HDF5 file.
    """

    name: str
    path: Path
    index: int | None = None
    laser_off: Path | None = None
    inside: str = ""


@dataclass(frozen=True, slots=True)
class DamagedFrame:
    """A frame of which there is no result.

    Parameters
    ----------
    frame : Frame
    why : str
        What was found and how to mend it.
    """

    frame: Frame
    why: str


class Stack(Protocol):
    """An open file of frames."""

    @property
    def frames(self) -> int | None:
        """How many frames it lists; None where it is a single picture."""
        ...

    def picture(self, index: int) -> Picture:
        """One frame as `read_picture` gives a picture.

        Raises
        ------
        FileError
            If this frame cannot be read; others may be.
        """
        ...
