"""Lengths between given image points, and between the ends of line pieces in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.pieces import line_pieces
from sheetoflight.io.pictures import PictureFile, list_pictures, picture_files, read_picture
from sheetoflight.io.quoting import shown
from sheetoflight.io.segments_csv import LengthRow, Segments, read_segments
from sheetoflight.measurement.comparison import MeasuredSegment
from sheetoflight.measurement.length import Length, lengths
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.workflow.spread import ALONE, Execution, spread


@dataclass(frozen=True)
class PictureLengths:
    """What was measured in one picture.

    Parameters
    ----------
    file : PictureFile
    pieces : tuple of LinePiece
        All pieces of the laser line; those that leave the picture have no length.
    segments : tuple of MeasuredSegment
        The others' lengths, in the order of `pieces`.
    laser : str, optional
        In whose sheet the line lies; may be left out where there is one laser.
    """

    file: PictureFile
    pieces: tuple[LinePiece, ...]
    segments: tuple[MeasuredSegment, ...]
    laser: str | None = None


def length_row(measured: MeasuredSegment) -> LengthRow:
    """A measured segment as ``lengths.csv`` holds it."""
    length = measured.length
    return measured.name, length.value, length.std, length.interval


def measure_segments(
    calibration: AnyCalibration, path: str | Path, laser: str | None = None
) -> list[MeasuredSegment]:
    """Lengths of the segments of a ``segments.csv``, in the order of its rows.

    Parameters
    ----------
    calibration : Calibration
    path : path
    laser : str, optional
        In whose sheet those segments lie that name no laser; may be left out where there is one.

    Raises
    ------
    FileError, InputError
        If the file cannot be used, or a point lies off the picture or looks away from the sheet.
    """
    return measured_segments(calibration, read_segments(path), laser)


def measured_segments(
    calibration: AnyCalibration, segments: Segments, laser: str | None = None
) -> list[MeasuredSegment]:
    """Lengths of segments that were read, in their order; see `measure_segments`."""
    lasers = _lasers_of(calibration, segments, laser)
    std = None
    if segments.std is not None:
        std = np.where(np.isfinite(segments.std), segments.std, calibration.pixel_std)
    found: dict[int, Length] = {}
    for name in dict.fromkeys(lasers):
        rows = [row for row, other in enumerate(lasers) if other == name]
        names = tuple(segments.names[row] for row in rows)
        own_std = None if std is None else std[rows]
        measured = lengths(calibration, segments.uv[rows], own_std, names, name)
        found |= dict(zip(rows, measured, strict=True))
    return [
        MeasuredSegment(name, segments.uv[row], found[row], lasers[row])
        for row, name in enumerate(segments.names)
    ]


def _lasers_of(
    calibration: AnyCalibration, segments: Segments, laser: str | None
) -> list[str | None]:
    """The laser of each segment: its own, or else `laser`."""
    known = list(calibration.lasers)
    named = [own or laser for own in segments.laser or (None,) * len(segments)]
    for segment, name in zip(segments.names, named, strict=True):
        if name is None and len(known) > 1:
            raise InputError(
                f"segment {shown(segment)} names no laser, the calibration has "
                f"{' and '.join(known)}",
                "name one of them in column laser of segments.csv, or for all with --laser",
            )
        if name is not None and name not in known:
            raise InputError(
                f"segment {shown(segment)} lies on the laser {shown(name)}, which the "
                "calibration does not have",
                f"choose {' | '.join(known)}",
            )
    return named


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
    calibration: AnyCalibration,
    files: Sequence[PictureFile],
    run: Execution = ALONE,
    laser: str | None = None,
) -> list[PictureLengths]:
    """Lengths between the ends of each whole piece of the laser line.

    Parameters
    ----------
    calibration : Calibration
    files : sequence of PictureFile
    run : Execution
    laser : str, optional
        Which laser is on in the pictures; may be left out where there is one.

    Raises
    ------
    FileError, InputError
        If a picture cannot be read or has another size than the calibrated camera's, or the
        laser is not known.
    """
    if files:
        _refuse_unknown_laser(calibration, laser)
    found = spread(
        partial(found_pieces, image_size=calibration.image_size),
        files,
        "find the line",
        run,
    )
    return [
        PictureLengths(file, pieces, piece_lengths(calibration, file.name, pieces, laser), laser)
        for file, pieces in zip(files, found, strict=True)
    ]


def _refuse_unknown_laser(calibration: AnyCalibration, laser: str | None) -> None:
    known = list(calibration.lasers)
    if laser is None and len(known) > 1:
        raise InputError(
            f"the calibration has the lasers {' and '.join(known)}, and which of them is on in "
            "the pictures is not said",
            "name it with --laser, and measure the pictures of each laser by themselves",
        )
    calibration.sheet(laser)


def found_pieces(file: PictureFile, image_size: tuple[int, int]) -> tuple[LinePiece, ...]:
    """The pieces of the line in one picture or pair of pictures."""
    on, off = laser_pictures(file)
    _refuse_other_size(file.laser_on or file.path, on, image_size)
    if off is not None:
        _refuse_other_size(file.path, off, image_size)
    return line_pieces(on, off)


def _refuse_other_size(path: Path, picture: np.ndarray, expected: tuple[int, int]) -> None:
    height, width = picture.shape[:2]
    if (width, height) != tuple(expected):
        raise InputError(
            f"{path.name} has {width}×{height} pixels, the calibrated camera "
            f"{expected[0]}×{expected[1]}",
            "measure in pictures of the calibrated camera, uncropped",
        )


def laser_pictures(file: PictureFile) -> tuple[np.ndarray, np.ndarray | None]:
    """The picture with the laser on, and the one with the laser off where there is one."""
    if file.laser_on is None:
        return read_picture(file.path), None
    return read_picture(file.laser_on), read_picture(file.path)


def piece_lengths(
    calibration: AnyCalibration,
    name: str,
    pieces: Sequence[LinePiece],
    laser: str | None = None,
) -> tuple[MeasuredSegment, ...]:
    """Lengths of the whole pieces, numbered from 1 where there are several."""
    whole = [piece for piece in pieces if piece.whole]
    if not whole:
        return ()
    names = (name,) if len(whole) == 1 else tuple(f"{name}-{i + 1}" for i in range(len(whole)))
    ends: Array = np.stack([piece.ends for piece in whole])
    std = np.stack([piece.ends_std for piece in whole])
    found = lengths(calibration, ends, std, names, laser)
    return tuple(
        MeasuredSegment(*measured, laser) for measured in zip(names, ends, found, strict=True)
    )
