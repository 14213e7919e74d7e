"""The pictures of a rig folder, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.pictures import PictureFile, holds_pictures, list_pictures, read_picture
from sheetoflight.io.quoting import file_name


@dataclass(frozen=True)
class Pictured:
    """A view's name in its stage, its picture, and the number of its laser."""

    view: str
    file: PictureFile
    laser: int = 0


def pictured(folder: Path, lasers: tuple[str, ...]) -> list[Pictured]:
    """The pictures of a stage; of several lasers each has a folder of its name."""
    if len(lasers) < 2:
        return [Pictured(file.name, file) for file in list_pictures(folder)]
    missing = [name for name in lasers if not (folder / name).is_dir()]
    if missing or holds_pictures(folder):
        found = f"no folder {missing[0]}/" if missing else "pictures that name no laser"
        raise InputError(
            f"{file_name(folder)} holds {found}, but the rig has {len(lasers)} lasers",
            "put the pictures of the target in each sheet into "
            + " and ".join(f"{folder.name}/{name}/" for name in lasers),
        )
    return [
        Pictured(f"{name}/{file.name}", file, laser)
        for laser, name in enumerate(lasers)
        for file in list_pictures(folder / name)
    ]


def held_pictures(place: Path, lasers: tuple[str, ...]) -> list[Pictured]:
    """The pictures of a stage that need not be there: of several lasers in a folder for each."""
    places = [place, *(place / name for name in lasers)]
    held = any(folder.is_dir() and holds_pictures(folder) for folder in places)
    return pictured(place, lasers) if held else []


def refuse_unlike_pair(file: PictureFile) -> None:
    """The target is searched for in the picture without laser; the other is of the same view."""
    if file.laser_on is None:
        return
    off, on = size_of(read_picture(file.path)), size_of(read_picture(file.laser_on))
    if on != off:
        raise InputError(
            f"{file_name(file.laser_on)} has {on[0]}×{on[1]} pixels, {file.path.name} has "
            f"{off[0]}×{off[1]}",
            "give both pictures of a pair from one camera, uncropped",
        )


def size_of(picture: np.ndarray) -> tuple[int, int]:
    """Width and height, px."""
    height, width = picture.shape[:2]
    return width, height


def refuse_other_size(picture: Path, found: tuple[int, int], expected: tuple[int, int]) -> None:
    """All pictures of a rig are of one size."""
    if found != expected:
        raise InputError(
            f"{file_name(picture)} has {found[0]}×{found[1]} pixels, the rig's pictures have "
            f"{expected[0]}×{expected[1]}",
            "remove it, or correct image_size in rig.toml; all pictures must come from one "
            "camera, uncropped",
        )
