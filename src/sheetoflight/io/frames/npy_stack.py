"""Stacks in NumPy's ``.npy``, read one frame at a time."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sheetoflight.errors import FileError
from sheetoflight.io.frames.opened import refuse_no_file, refusing
from sheetoflight.io.frames.samples import Layout, as_picture, layout_of
from sheetoflight.io.pictures import Picture
from sheetoflight.io.quoting import file_name, one_line

_LONGEST_HEADER = 64 * 1024


@dataclass(frozen=True)
class NpyStack:
    """An open stack. It is read, not mapped: mapped pages would count as this process's memory.

    Parameters
    ----------
    name : str
    file : binary file
    layout : Layout
        As the header states it.
    start : int
        Where the samples begin, in bytes.
    whole : int
        How many frames the file holds to their last byte.
    """

    name: str
    file: BinaryIO
    layout: Layout
    start: int
    whole: int

    @property
    def frames(self) -> int | None:
        """Those that are whole, and one more where the file ends early."""
        if self.layout.frames is None:
            return None
        return self.whole + (self.whole < self.layout.frames)

    def picture(self, index: int) -> Picture:
        """One frame."""
        if index >= self.whole:
            raise self._cut_short()
        self.file.seek(self.start + index * self.layout.frame_bytes)
        count = self.layout.frame_bytes // self.layout.dtype.itemsize
        samples = np.fromfile(self.file, self.layout.dtype, count)
        if samples.size < count:
            raise self._cut_short()
        return as_picture(samples.reshape(self.layout.shape))

    def _cut_short(self) -> FileError:
        stated = self.layout.frames or 1
        return FileError(
            f"{self.name} is cut short: {stated - self.whole} of its {stated} frames are missing",
            "copy or record it again, if the missing ones are needed",
        )


@contextmanager
def open_npy(path: Path, _inside: str, max_pixels: int) -> Iterator[NpyStack]:
    """Open a stack.

    Parameters
    ----------
    path : Path
    max_pixels : int
        Refuse frames with more pixels than this.

    Raises
    ------
    FileError
        If the header cannot be read, or claims what is no stack of pictures.
    """
    refuse_no_file(path)
    with refusing(path), path.open("rb", buffering=0) as file:
        layout, start = _header(path, file.read(_LONGEST_HEADER), max_pixels)
        present = (path.stat().st_size - start) // layout.frame_bytes
        whole = min(layout.frames or 1, max(present, 0))
        yield NpyStack(file_name(path), file, layout, start, whole)


def _header(path: Path, data: bytes, max_pixels: int) -> tuple[Layout, int]:
    """What the header states, and its length.

    The format: numpy.lib.format, versions 1 and 2; version 3 is for names of fields, which
    pictures do not have.
    """
    name, file = file_name(path), io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, columns_first, dtype = read(file)
    except (ValueError, KeyError, OverflowError, MemoryError, RecursionError) as error:
        raise FileError(
            f"{name} is damaged or no .npy file ({one_line(str(error))})",
            "write it again with numpy.save",
        ) from error
    if columns_first and len(shape) > 1:
        raise FileError(
            f"{name} holds its samples in Fortran's order, a frame scattered over the whole file",
            "write it again with numpy.save(…, numpy.ascontiguousarray(stack))",
        )
    return layout_of(name, shape, dtype, max_pixels), file.tell()
