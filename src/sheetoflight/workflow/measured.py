"""Lengths between given image points, and between the ends of line pieces in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.pieces import line_pieces
from sheetoflight.io.pictures import PictureFile, list_pictures, picture_files, read_picture
from sheetoflight.io.segments_csv import LengthRow, read_segments
from sheetoflight.measurement.length import Length, lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.workflow.spread import ALONE, Execution, spread


@dataclass(frozen=True)
class MeasuredLength:
    """A named length."""

    segment: str
    length: Length

    @property
    def row(self) -> LengthRow:
        """As ``lengths.csv`` holds it."""
        return self.segment, self.length.value, self.length.std, self.length.interval


@dataclass(frozen=True)
class PictureLengths:
    """What was measured in one picture.

    Parameters
    ----------
    file : PictureFile
    pieces : tuple of LinePiece
        All pieces of the laser line; those that leave the picture have no length.
    lengths : tuple of MeasuredLength
    """

    file: PictureFile
    pieces: tuple[LinePiece, ...]
    lengths: tuple[MeasuredLength, ...]


def measure_segments(calibration: Calibration, path: str | Path) -> list[MeasuredLength]:
    """Lengths of the segments of a ``segments.csv``.

    Raises
    ------
    FileError, InputError
        If the file cannot be used, or a point lies off the picture or looks away from the sheet.
    """
    segments = read_segments(path)
    std = None
    if segments.std is not None:
        std = np.where(np.isfinite(segments.std), segments.std, calibration.pixel_std)
    found = lengths(calibration, segments.uv, std, segments.names)
    return [MeasuredLength(n, value) for n, value in zip(segments.names, found, strict=True)]


def pictures_named(paths: Sequence[str | Path]) -> list[PictureFile]:
    """The pictures that paths name, a folder standing for all pictures in it.

    Raises
    ------
    FileError, InputError
        If a path is missing, or a folder holds no picture.
    """
    named = list(dict.fromkeys(Path(path) for path in paths))
    single = [path for path in named if not path.is_dir()]
    files = [file for path in named if path.is_dir() for file in list_pictures(path)]
    return [*files, *picture_files(single)] if single else files


def measure_pictures(
    calibration: Calibration,
    files: Sequence[PictureFile],
    run: Execution = ALONE,
) -> list[PictureLengths]:
    """Lengths between the ends of each whole piece of the laser line.

    Raises
    ------
    FileError, InputError
        If a picture cannot be read or has another size than the calibrated camera's.
    """
    found = spread(
        partial(found_pieces, image_size=calibration.camera.image_size),
        files,
        "find the line",
        run,
    )
    return [
        PictureLengths(file, pieces, piece_lengths(calibration, file.name, pieces))
        for file, pieces in zip(files, found, strict=True)
    ]


def found_pieces(file: PictureFile, image_size: tuple[int, int]) -> tuple[LinePiece, ...]:
    """The pieces of the line in one picture or pair of pictures."""
    on, off = laser_pictures(file)
    height, width = on.shape[:2]
    if (width, height) != tuple(image_size):
        raise InputError(
            f"{file.path.name} has {width}×{height} pixels, the calibrated camera "
            f"{image_size[0]}×{image_size[1]}",
            "measure in pictures of the calibrated camera, uncropped",
        )
    return line_pieces(on, off)


def laser_pictures(file: PictureFile) -> tuple[np.ndarray, np.ndarray | None]:
    """The picture with the laser on, and the one with the laser off where there is one."""
    if file.laser_on is None:
        return read_picture(file.path), None
    return read_picture(file.laser_on), read_picture(file.path)


def piece_lengths(
    calibration: Calibration, name: str, pieces: Sequence[LinePiece]
) -> tuple[MeasuredLength, ...]:
    """Lengths of the whole pieces, numbered from 1 where there are several."""
    whole = [piece for piece in pieces if piece.whole]
    if not whole:
        return ()
    names = (name,) if len(whole) == 1 else tuple(f"{name}-{i + 1}" for i in range(len(whole)))
    ends = np.stack([piece.ends for piece in whole])
    std = np.stack([piece.ends_std for piece in whole])
    found = lengths(calibration, ends, std, names)
    return tuple(MeasuredLength(n, value) for n, value in zip(names, found, strict=True))
