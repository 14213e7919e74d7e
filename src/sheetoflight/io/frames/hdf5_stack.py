"""Stacks in HDF5 files, read one frame at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames.opened import refuse_no_file, refusing
from sheetoflight.io.frames.samples import Layout, as_picture, layout_of
from sheetoflight.io.pictures import Picture
from sheetoflight.io.quoting import file_name, one_line

ENDINGS = frozenset((".h5", ".hdf5"))

_CHUNK_CACHE_BYTES = 64 * 1024 * 1024
"""Frames packed together are unpacked once, not once each."""

_BYTES_PER_PIXEL = 8
_MOST_NAMED = 5


@dataclass(frozen=True)
class Hdf5Stack:
    """An open data set.

    Parameters
    ----------
    name : str
        Of the file and the data set.
    dataset : h5py.Dataset
    layout : Layout
    """

    name: str
    dataset: Any
    layout: Layout

    @property
    def frames(self) -> int | None:
        """Those that the data set states."""
        return self.layout.frames

    def picture(self, index: int) -> Picture:
        """One frame."""
        try:
            return as_picture(self.dataset[() if self.layout.frames is None else index])
        except (OSError, ValueError, RuntimeError) as error:
            raise FileError(
                f"{self.name}: frame {index} is damaged ({one_line(str(error))})",
                "copy or record it again",
            ) from error


def split_name(path: Path) -> tuple[Path, str]:
    """``file.h5:/path/in/file`` in its two parts; the second is empty where none is given."""
    folder, _, rest = str(path).rpartition(":")
    if folder and rest.startswith("/") and Path(folder).suffix.lower() in ENDINGS:
        return Path(folder), rest
    return path, ""


@contextmanager
def open_hdf5(path: Path, inside: str, max_pixels: int) -> Iterator[Hdf5Stack]:
    """Open a data set.

    Parameters
    ----------
    path : Path
    inside : str
        Path of the data set within the file; empty for the only one of three or four axes.
    max_pixels : int
        Refuse frames with more pixels than this.

    Raises
    ------
    FileError
        If the file cannot be read, or the data set is no stack of pictures.
    InputError
        If it holds several data sets and none is named, or h5py is not installed.
    """
    refuse_no_file(path)
    h5py = _h5py()
    with (
        refusing(path, RuntimeError, ValueError, KeyError, TypeError),
        h5py.File(os.fspath(path), "r", rdcc_nbytes=_CHUNK_CACHE_BYTES) as file,
    ):
        place = inside or _only_stack(path, file, h5py)
        name = f"{file_name(path)}:{one_line(place)}"
        dataset = _dataset(path, file, place, h5py)
        layout = layout_of(name, dataset.shape or (), dataset.dtype, max_pixels)
        _refuse_large_chunks(name, dataset, max_pixels)
        yield Hdf5Stack(name, dataset, layout)


def _h5py() -> ModuleType:
    try:
        import h5py
    except ImportError as error:
        raise InputError(
            "HDF5 files are read with h5py, which is not installed", "pip install h5py"
        ) from error
    return h5py


def _stacks(file: Any, h5py: ModuleType) -> list[str]:
    found: list[str] = []

    def look(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and len(item.shape or ()) in (3, 4):
            found.append(f"/{name}")

    file.visititems(look)
    return found


def _only_stack(path: Path, file: Any, h5py: ModuleType) -> str:
    found = _stacks(file, h5py)
    if not found:
        raise FileError(
            f"{file_name(path)} holds no data set of three or four axes",
            "store the frames in one data set (frames, height, width)",
        )
    if len(found) > 1:
        raise InputError(
            f"{file_name(path)} holds {len(found)} data sets that may be frames: {_named(found)}",
            f"name one of them: {file_name(path)}:{one_line(found[0])}",
        )
    return found[0]


def _dataset(path: Path, file: Any, place: str, h5py: ModuleType) -> Any:
    try:
        item = file[place]
    except (KeyError, ValueError, RuntimeError):
        item = None
    if not isinstance(item, h5py.Dataset):
        raise FileError(
            f"{file_name(path)} holds no data set {one_line(place)}",
            f"choose of {_named(_stacks(file, h5py))}",
        )
    return item


def _refuse_large_chunks(name: str, dataset: Any, max_pixels: int) -> None:
    """To read one frame, the library makes room for every chunk that it touches."""
    chunk = dataset.dtype.itemsize
    for side in dataset.chunks or ():
        chunk *= side
    if chunk > max_pixels * _BYTES_PER_PIXEL:
        raise FileError(
            f"{name} is packed in chunks of {chunk} bytes", "write it again, a frame in a chunk"
        )


def _named(places: list[str]) -> str:
    more = len(places) - _MOST_NAMED
    shown = " ".join(one_line(place) for place in places[:_MOST_NAMED])
    return f"{shown} and {more} more" if more > 0 else shown or "none"
