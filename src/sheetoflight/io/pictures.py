"""Pictures read and written, and a folder's pictures listed in pairs of laser off and on."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.picture_checks import Claims, DamagedPictureError, claims
from sheetoflight.io.picture_decoding import (
    MAX_PIXELS,
    Picture,
    as_png,
    decoded_picture,
    is_picture,
    refuse_many_pixels,
    refuse_other_samples,
)
from sheetoflight.io.quoting import file_name, one_line
from sheetoflight.io.reading import read_bytes

__all__ = [
    "ENDINGS",
    "MAX_PIXELS",
    "Picture",
    "PictureFile",
    "holds_pictures",
    "in_order_of_names",
    "list_pictures",
    "picture_files",
    "read_picture",
    "write_picture",
]

ENDINGS = frozenset(
    (
        *(".avif", ".bmp", ".dib", ".jp2", ".jpe", ".jpeg", ".jpg", ".pam", ".pbm", ".pgm"),
        *(".png", ".pnm", ".ppm", ".ras", ".sr", ".tif", ".tiff", ".webp"),
    )
)
"""Endings of picture files, in lower case."""

_BYTES_PER_PIXEL = 8


@dataclass(frozen=True)
class PictureFile:
    """One view's picture, or pair of pictures.

    Parameters
    ----------
    name : str
        File name without ``_off``, ``_on`` and ending.
    path : Path
        The picture; of a pair, the one with the laser off.
    laser_on : Path or None
        The picture of a pair with the laser on.
    """

    name: str
    path: Path
    laser_on: Path | None = None


def read_picture(path: str | Path, max_pixels: int = MAX_PIXELS) -> Picture:
    """A picture as the sensor saw it: not turned by what the file says of the camera's pose.

    Parameters
    ----------
    path : str or Path
        Any format that OpenCV or tifffile reads, 8 or 16 bit.
    max_pixels : int
        Refuse pictures with more pixels than this.

    Returns
    -------
    (height, width) or (height, width, 3) array of uint8 or uint16
        Grey, or colour in the order blue, green, red. Transparency is left out.

    Raises
    ------
    FileError
        If the file is missing, damaged, cut short, no picture, too large, holds several
        pictures, or samples that are neither 8 nor 16 bit. (Damage inside the packed data of a
        JPEG, or of a TIFF that is packed by LZW or PackBits, leaves no trace that could be found.)
    """
    name = file_name(path)
    data = read_bytes(path, max_pixels * _BYTES_PER_PIXEL)
    if not data:
        raise FileError(f"{name} is empty", "copy or record the picture again")
    try:
        stated = claims(data)
    except DamagedPictureError as error:
        raise FileError(
            f"{name} is damaged: {error}", "copy or record the picture again"
        ) from error
    if stated:
        _check_claims(name, stated, max_pixels)
    picture = decoded_picture(data)
    if picture is None:
        raise FileError(
            f"{name} is damaged or in a format that cannot be read",
            "copy or record it again, or save it as PNG or TIFF",
        )
    return _checked(name, picture, stated, max_pixels)


def write_picture(path: str | Path, picture: Picture) -> None:
    """Write a picture as PNG, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Its ending must be ``.png``.
    picture : (height, width) or (height, width, 3) array of uint8 or uint16
        Grey, or blue, green, red.

    Raises
    ------
    InputError
        If the array is no such picture, or the ending is another.
    FileError
        If the file cannot be written.
    """
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"{file_name(path)} does not end in .png", "pictures are written as PNG")
    array = np.asarray(picture)
    if not is_picture(array):
        raise InputError(
            f"a picture for {file_name(path)} has shape {array.shape} and type {array.dtype}",
            "give (height, width) or (height, width, 3) of uint8 or uint16",
        )
    write_whole(path, as_png(array))


def list_pictures(folder: str | Path) -> list[PictureFile]:
    """The pictures of a folder by name, ``NAME_off.*`` and ``NAME_on.*`` joined to one.

    Numbers in names count by their value: see `in_order_of_names`.

    One of a pair alone is a picture by itself, called NAME too. Hidden files, folders, and
    files with other endings are left out.

    Raises
    ------
    InputError
        If there is no picture, or two of them have the same name.
    FileError
        If the folder is missing or cannot be read.
    """
    paths = _picture_paths(Path(folder))
    if not paths:
        raise InputError(
            f"{file_name(folder)} holds no picture",
            f"put pictures there ({' '.join(sorted(ENDINGS))})",
        )
    return picture_files(paths)


def holds_pictures(folder: str | Path) -> bool:
    """Whether there is any file that `list_pictures` lists.

    Raises
    ------
    FileError
        If the folder is missing or cannot be read.
    """
    return bool(_picture_paths(Path(folder)))


def picture_files(paths: Sequence[Path]) -> list[PictureFile]:
    """Pictures by name, ``NAME_off.*`` and ``NAME_on.*`` of one folder joined to one.

    Raises
    ------
    InputError
        If two pictures have the same name.
    """
    found: dict[tuple[str, str], Path] = {}
    for path in paths:
        key = _name_and_light(path)
        if key in found and found[key] != path:
            raise InputError(
                f"{file_name(path.parent)}: {one_line(found[key].name)} and "
                f"{one_line(path.name)} are pictures of the same name",
                "remove or rename one of them",
            )
        found[key] = path
    names = sorted({name for name, _ in found}, key=in_order_of_names)
    return [_picture_file(name, found) for name in names]


def in_order_of_names(name: str) -> tuple[tuple[tuple[str, int], ...], str]:
    """By what names are sorted, so that numbers in them count by their value.

    Examples
    --------
    >>> sorted(["f10", "f2", "f02", "e"], key=in_order_of_names)
    ['e', 'f02', 'f2', 'f10']
    """
    parts = re.split(r"(\d+)", name, flags=re.ASCII)
    numbers = [int(number) for number in parts[1::2]]
    return tuple(zip(parts[::2], [*numbers, -1], strict=True)), name


def _picture_paths(folder: Path) -> list[Path]:
    try:
        paths = sorted(folder.iterdir())
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FileError(
            f"{file_name(folder)} is no folder that can be read ({reason})", "check its name"
        ) from error
    return [
        path
        for path in paths
        if path.suffix.lower() in ENDINGS and not path.name.startswith(".") and path.is_file()
    ]


def _name_and_light(path: Path) -> tuple[str, str]:
    """The view's name, and ``off``, ``on`` or nothing."""
    name, _, light = path.stem.rpartition("_")
    return (name, light.lower()) if name and light.lower() in ("off", "on") else (path.stem, "")


def _picture_file(name: str, found: dict[tuple[str, str], Path]) -> PictureFile:
    single, off, on = (found.get((name, light)) for light in ("", "off", "on"))
    if single and (off or on):
        other = off or on or single
        raise InputError(
            f"{file_name(single.parent)}: {one_line(single.name)} and {one_line(other.name)} are "
            "pictures of the same name",
            "remove or rename one of them",
        )
    path = single or off or found[name, "on"]
    return PictureFile(name, path, on if off else None)


def _check_claims(name: str, stated: Claims, max_pixels: int) -> None:
    refuse_many_pixels(name, stated.width, stated.height, max_pixels)
    if stated.pictures > 1:
        raise FileError(
            f"{name} holds {stated.pictures} pictures, expected one",
            "save every picture in a file of its own",
        )


def _checked(name: str, picture: NDArray[Any], stated: Claims | None, max_pixels: int) -> Picture:
    refuse_other_samples(name, picture)
    height, width = picture.shape[:2]
    if stated and (width, height) != (stated.width, stated.height):
        raise FileError(
            f"{name} states {stated.width} × {stated.height} px and holds {width} × {height}",
            "copy or record the picture again",
        )
    refuse_many_pixels(name, width, height, max_pixels)
    return picture
