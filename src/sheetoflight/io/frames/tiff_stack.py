"""Stacks of pictures in one TIFF, read one page at a time."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tifffile
from numpy.typing import NDArray

from sheetoflight.errors import FileError
from sheetoflight.io.frames.opened import refuse_no_file, refusing
from sheetoflight.io.frames.tiff_directories import Directories, directories
from sheetoflight.io.picture_checks import fault_of, silent
from sheetoflight.io.picture_decoding import (
    DECODING,
    Picture,
    blue_green_red,
    decoded_page,
    refuse_many_pixels,
    refuse_other_samples,
)
from sheetoflight.io.quoting import file_name

ENDINGS = frozenset((".tif", ".tiff"))

_AGAIN = "copy or record it again"


@dataclass(frozen=True)
class _Run:
    """Frames one behind the other after the first page, whose directory alone describes them.

    So tifffile and ImageJ write a stack: its other directories come last, or not at all.
    """

    start: int
    stated: int
    whole: int


@dataclass(frozen=True)
class TiffStack:
    """An open TIFF.

    Parameters
    ----------
    name : str
    path : Path
    file : tifffile.TiffFile
    pages : Directories
    run : _Run or None
        Where frames lie that have no directory.
    max_pixels : int
    """

    name: str
    path: Path
    file: tifffile.TiffFile
    pages: Directories
    run: _Run | None
    max_pixels: int

    @property
    def frames(self) -> int | None:
        """Those that are there, and one more where the file ends early; None for a single one."""
        if self.run:
            return self.run.whole + (self.run.whole < self.run.stated)
        count = len(self.pages.offsets) + self.pages.broken
        return count if count > 1 else None

    def picture(self, index: int) -> Picture:
        """One frame."""
        name = f"{self.name}[{index}]"
        if self.run:
            return self._of_run(index, self.run)
        if index >= len(self.pages.offsets):
            raise FileError(
                f"{self.name} breaks off after {len(self.pages.offsets)} pictures; how many are "
                "missing cannot be seen",
                _AGAIN,
            )
        page = self._page(name, index)
        _refuse_claims(name, page, self.file.filehandle.size, self.max_pixels)
        return _checked(name, page, self._decoded(page, index))

    def _page(self, name: str, index: int) -> tifffile.TiffPage:
        try:
            with silent("tifffile"):
                self.file.filehandle.seek(self.pages.offsets[index])
                return tifffile.TiffPage(self.file, index)
        except Exception as error:  # of a damaged file tifffile lets out errors of any type
            raise FileError(f"{name} is damaged: its directory makes no sense", _AGAIN) from error

    def _decoded(self, page: tifffile.TiffPage, index: int) -> NDArray[Any] | None:
        number = self.pages.numbers[index]

        def by_opencv() -> NDArray[Any] | None:
            found, pictures = cv2.imreadmulti(str(self.path), number, 1, flags=DECODING)
            return pictures[0] if found and len(pictures) == 1 else None

        return decoded_page(page, by_opencv)

    def _of_run(self, index: int, run: _Run) -> Picture:
        if index >= run.whole:
            raise FileError(
                f"{self.name} is cut short: {run.stated - run.whole} of its {run.stated} frames "
                "are missing",
                _AGAIN,
            )
        name = f"{self.name}[{index}]"
        page = self._page(name, 0)
        _refuse_claims(name, page, self.file.filehandle.size, self.max_pixels)
        self.file.filehandle.seek(run.start + index * page.nbytes)
        dtype = np.dtype(page.dtype).newbyteorder(self.file.byteorder)
        samples = np.frombuffer(self.file.filehandle.read(page.nbytes), dtype)
        native = samples.astype(page.dtype).reshape(page.shape)
        return _checked(name, page, blue_green_red(page, native))


@contextmanager
def open_tiff(path: Path, _inside: str, max_pixels: int) -> Iterator[TiffStack]:
    """Open a TIFF.

    Parameters
    ----------
    path : Path
    max_pixels : int
        Refuse pages with more pixels than this, when their turn comes.

    Raises
    ------
    FileError
        If the file cannot be read, or is no TIFF.
    """
    refuse_no_file(path)
    with refusing(path):
        pages = directories(path)
    with _tiff_file(path) as file:
        yield TiffStack(file_name(path), path, file, pages, _run(file, pages), max_pixels)


def _tiff_file(path: Path) -> tifffile.TiffFile:
    try:
        with silent("tifffile"):
            return tifffile.TiffFile(path)
    except Exception as error:  # of a damaged file tifffile lets out errors of any type
        raise FileError(f"{file_name(path)} is damaged or no TIFF", _AGAIN) from error


def holds_stack(path: Path) -> bool:
    """Whether a TIFF has more than one page, or says so. What is no TIFF has none.

    Raises
    ------
    FileError
        If the file is missing or cannot be read.
    """
    refuse_no_file(path)
    with refusing(path):
        pages = directories(path)
    if not pages.offsets:
        return False
    if len(pages.offsets) > 1 or pages.broken:
        return True
    try:
        with open_tiff(path, "", 0) as stack:
            return stack.frames is not None
    except FileError:
        return False


def _run(file: tifffile.TiffFile, pages: Directories) -> _Run | None:
    """The frames behind the first page, where it states more than have a directory."""
    try:
        with silent("tifffile"):
            page = file.pages[0]
            stated = _stated_frames(page)
            if not isinstance(page, tifffile.TiffPage) or stated <= len(pages.offsets):
                return None
            if not page.is_contiguous or page.compression != 1 or page.nbytes < 1:
                return None
            start = int(page.dataoffsets[0])
            whole = max(file.filehandle.size - start, 0) // page.nbytes
    except Exception:  # of a damaged file tifffile lets out errors of any type
        return None
    return _Run(start, stated, min(whole, stated))


def _stated_frames(page: Any) -> int:
    """How many frames the first page's description states: as tifffile or ImageJ writes it."""
    words = page.description
    if page.is_imagej:
        found = re.search(r"^images=(\d{1,12})$", words, re.MULTILINE)
        return int(found[1]) if found else 1
    if not page.is_shaped:
        return 1
    shape = json.loads(words).get("shape", page.shape)
    own = len(page.shape)
    return shape[0] if len(shape) == own + 1 and tuple(shape[1:]) == page.shape else 1


def _refuse_claims(name: str, page: tifffile.TiffPage, size: int, max_pixels: int) -> None:
    """Refuse a page before anything makes room for it."""
    refuse_many_pixels(name, int(page.imagewidth), int(page.imagelength), max_pixels)
    fault = fault_of(page, size)
    if fault:
        raise FileError(f"{name} {fault}", _AGAIN)


def _checked(name: str, page: tifffile.TiffPage, samples: NDArray[Any] | None) -> Picture:
    if samples is None:
        raise FileError(f"{name} is damaged or packed in a way that is not read", _AGAIN)
    refuse_other_samples(name, samples)
    if samples.shape[:2] != (page.imagelength, page.imagewidth):
        raise FileError(f"{name} holds another size than it states", _AGAIN)
    return samples
