"""Files of frames, each by its format's own writer, and what tests ask of the frames read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import tifffile

from sheetoflight.io.frames import DamagedFrame

RNG = np.random.default_rng(11)
GREY = RNG.integers(0, 256, (12, 32, 48), dtype=np.uint8)
GREY_16 = RNG.integers(0, 65536, (12, 32, 48), dtype=np.uint16)
COLOUR = RNG.integers(0, 256, (12, 32, 48, 3), dtype=np.uint8)
"""Red, green, blue."""
COLOUR_16 = RNG.integers(0, 65536, (12, 32, 48, 3), dtype=np.uint16)
STACKS = {"grey": GREY, "grey 16": GREY_16, "colour": COLOUR, "colour 16": COLOUR_16}

Writer = Callable[[Path, np.ndarray], Path]


def npy(folder: Path, stack: np.ndarray) -> Path:
    np.save(folder / "stack.npy", stack)
    return folder / "stack.npy"


def npy_big_endian(folder: Path, stack: np.ndarray) -> Path:
    return npy(folder, stack.astype(stack.dtype.newbyteorder(">")))


def hdf5(folder: Path, stack: np.ndarray) -> Path:
    with h5py.File(folder / "stack.h5", "w") as file:
        file["entry/data"] = stack
        file["entry/exposure"] = np.arange(len(stack))
    return folder / "stack.h5"


def hdf5_packed(folder: Path, stack: np.ndarray) -> Path:
    """Five frames in a chunk, which do not divide twelve."""
    with h5py.File(folder / "stack.hdf5", "w") as file:
        chunks = (5, *stack.shape[1:])
        file.create_dataset("frames", data=stack, chunks=chunks, compression="gzip")
    return folder / "stack.hdf5"


def tiff(folder: Path, stack: np.ndarray) -> Path:
    """All frames first, then all directories but the first."""
    colour = "rgb" if stack.ndim == 4 else "minisblack"
    tifffile.imwrite(folder / "stack.tif", stack, photometric=colour)
    return folder / "stack.tif"


def tiff_by_pages(folder: Path, stack: np.ndarray, bigtiff: bool = False) -> Path:
    """As a camera records: page by page, each behind its directory."""
    colour = "rgb" if stack.ndim == 4 else "minisblack"
    with tifffile.TiffWriter(folder / "stack.tiff", bigtiff=bigtiff, byteorder=">") as file:
        for picture in stack:
            file.write(picture, photometric=colour, contiguous=False, metadata=None)
    return folder / "stack.tiff"


def bigtiff(folder: Path, stack: np.ndarray) -> Path:
    return tiff_by_pages(folder, stack, bigtiff=True)


def tiff_packed(folder: Path, stack: np.ndarray) -> Path:
    """By OpenCV's writer, which packs with LZW."""
    pictures = [np.ascontiguousarray(picture) for picture in blue_green_red(stack)]
    assert cv2.imwritemulti(str(folder / "stack.tif"), pictures)
    return folder / "stack.tif"


WRITERS: tuple[Writer, ...] = (
    *(npy, npy_big_endian, hdf5, hdf5_packed, tiff, tiff_by_pages, bigtiff, tiff_packed),
)


def blue_green_red(stack: np.ndarray) -> np.ndarray:
    return stack[..., ::-1] if stack.ndim == 4 else stack


def video(path: Path, code: str, pictures: Iterable[np.ndarray]) -> Path:
    """A video of pictures in blue, green, red, by OpenCV's writer."""
    pictures = list(pictures)
    height, width = pictures[0].shape[:2]
    file = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), 25.0, (width, height))
    if not file.isOpened():
        pytest.skip(f"this OpenCV writes no {code}")
    for picture in pictures:
        file.write(np.ascontiguousarray(picture))
    file.release()
    return path


def lit(found: object) -> np.ndarray:
    """The picture of a frame that is whole and has no partner."""
    assert not isinstance(found, DamagedFrame), found.why
    on, off = found  # type: ignore[misc]
    assert off is None
    return on


def whys(found: Sequence[object]) -> dict[int, str]:
    """Why which frames are damaged."""
    return {i: one.why for i, one in enumerate(found) if isinstance(one, DamagedFrame)}


def cut(path: Path, length: int) -> Path:
    """The file's first bytes, in its place."""
    path.write_bytes(path.read_bytes()[:length])
    return path


def numbered(number: int) -> np.ndarray:
    """A picture that shows its number as eight black and white bars."""
    bars = [255 * (number >> bit & 1) for bit in range(8)]
    return np.broadcast_to(np.repeat(bars, 16)[None, :, None], (64, 128, 3)).astype(np.uint8)


def number_of(picture: np.ndarray) -> int:
    bars = picture.reshape(64, 8, 16, 3).mean(axis=(0, 2, 3)) > 128
    return sum(1 << bit for bit in range(8) if bars[bit])
