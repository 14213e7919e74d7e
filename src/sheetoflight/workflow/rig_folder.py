"""A rig folder read: what is known of the rig, and what its pictures show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.imaging.markers import TargetSearch, find_target, order_by_fixed_end
from sheetoflight.io.check_views import check_views
from sheetoflight.io.pictures import PictureFile, holds_pictures, list_pictures, read_picture
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.io.quoting import file_name
from sheetoflight.io.reading import TEXT_LIMIT_BYTES, read_bytes
from sheetoflight.io.rig_toml import RigFile, read_rig_toml
from sheetoflight.model.observations import Observations, TargetViews, no_views
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.crossings import Crossing, crossing_views, searched_crossing
from sheetoflight.workflow.spread import ALONE, Execution, spread

STAGES = ("camera", "plane")
"""Stages in whose pictures the target is searched for."""

POINTS = "points.csv"


@dataclass(frozen=True)
class Missed:
    """A picture in which the target was not found, and why."""

    stage: str
    view: str
    reason: str


@dataclass(frozen=True)
class Detection:
    """What the pictures of a rig folder show.

    Parameters
    ----------
    rig : Rig
        With its observations.
    missed : tuple of Missed
    """

    rig: Rig
    missed: tuple[Missed, ...]


def load_rig(folder: str | Path, run: Execution = ALONE) -> Rig:
    """Read a rig folder: ``rig.toml``, and ``points.csv`` or else the pictures.

    Raises
    ------
    FileError, InputError
        If the folder, a file or a picture cannot be used; the message names it.
    UntrustworthyError
        If no picture of a stage shows the target, or the laser's spot on it.
    """
    folder = Path(folder)
    described = _described(folder)
    if not (folder / POINTS).exists():
        return _detected(folder, described, run).rig
    observations = read_points(folder / POINTS, described.target, described.lasers)
    rig = described.rig(observations, picture_size=_first_picture_size(folder, described))
    check_views(rig)
    return rig


def detect(folder: str | Path, run: Execution = ALONE) -> Detection:
    """Find the target in all pictures of a rig folder and write ``points.csv``.

    What ``points.csv`` held of stage crossing stays in it where there are no pictures of that.

    Raises
    ------
    FileError, InputError
        If the folder, a file or a picture cannot be used; the message names it.
    UntrustworthyError
        If no picture of a stage shows the target, or the laser's spot on it.
    """
    folder = Path(folder)
    detection = _detected(folder, _described(folder), run)
    write_points(folder / POINTS, detection.rig.observations, detection.rig.lasers)
    return detection


def _described(folder: Path) -> RigFile:
    if not folder.is_dir():
        raise FileError(
            f"{folder} is no folder", "name a rig folder, that is one with a rig.toml in it"
        )
    return read_rig_toml(folder / "rig.toml")


@dataclass(frozen=True)
class _Pictured:
    """A view's name in its stage, its picture, and the number of its laser."""

    view: str
    file: PictureFile
    laser: int = 0


def _stage_folders(folder: Path, lasers: tuple[str, ...]) -> dict[str, list[_Pictured]]:
    found = {
        stage: _pictured(folder / stage, lasers if stage == "plane" else ())
        for stage in STAGES
        if (folder / stage).is_dir()
    }
    if not found:
        raise InputError(
            f"{folder} holds neither {POINTS} nor a folder {' or '.join(STAGES)} with pictures",
            "put the pictures of the pivoting target into camera/, those of the target in the "
            "sheet of light into plane/",
        )
    return found


def _pictured(folder: Path, lasers: tuple[str, ...]) -> list[_Pictured]:
    """The pictures of a stage; of several lasers each has a folder of its name."""
    if len(lasers) < 2:
        return [_Pictured(file.name, file) for file in list_pictures(folder)]
    missing = [name for name in lasers if not (folder / name).is_dir()]
    if missing or holds_pictures(folder):
        found = f"no folder {missing[0]}/" if missing else "pictures that name no laser"
        raise InputError(
            f"{file_name(folder)} holds {found}, but the rig has {len(lasers)} lasers",
            "put the pictures of the target in each sheet into "
            + " and ".join(f"{folder.name}/{name}/" for name in lasers),
        )
    return [
        _Pictured(f"{name}/{file.name}", file, laser)
        for laser, name in enumerate(lasers)
        for file in list_pictures(folder / name)
    ]


def _first_picture_size(folder: Path, described: RigFile) -> tuple[int, int] | None:
    """Size of some picture, where the rig file leaves it open."""
    if described.image_size:
        return None
    sheets = [f"plane/{name}" for name in described.lasers]
    for place in ("camera", "plane", *sheets, "crossing"):
        if (folder / place).is_dir() and holds_pictures(folder / place):
            return _size(read_picture(list_pictures(folder / place)[0].path))
    return None


def _searched_crossing(file: PictureFile, target: CollinearTarget) -> Crossing:
    _refuse_unlike_pair(file, _size(read_picture(file.path)))
    return searched_crossing(file, target)


def _crossing(
    folder: Path, described: RigFile, size: tuple[int, int] | None, run: Execution
) -> tuple[TargetViews, list[Missed], tuple[int, int] | None]:
    """Views of stage crossing, what was missed, and the pictures' size: searched for in the
    pictures, where there are any, or else as ``points.csv`` has them."""
    pictured = _crossing_pictures(folder / "crossing", described.lasers)
    if not pictured:
        return _crossing_kept(folder, described), [], size
    files = [picture.file for picture in pictured]
    search = partial(_searched_crossing, target=described.target)
    found = list(spread(search, files, "detect crossing", run))
    for file, outcome in zip(files, found, strict=True):
        size = size or outcome.size
        _refuse_other_size(file.path.relative_to(folder), outcome.size, size)
    missed = [
        Missed("crossing", picture.view, outcome.reason)
        for picture, outcome in zip(pictured, found, strict=True)
        if outcome.spot is None
    ]
    if len(missed) == len(found):
        raise UntrustworthyError(
            "crossing",
            f"the laser's spot on the target was seen in none of {len(found)} pictures; "
            f"{files[0].path.name}: {found[0].reason}",
            "check that the laser is on and its sheet crosses the target between markers",
        )
    names = [picture.view for picture in pictured]
    lasers = [picture.laser for picture in pictured]
    return crossing_views(names, lasers, found, len(described.lasers)), missed, size


def _crossing_pictures(crossing: Path, lasers: tuple[str, ...]) -> list[_Pictured]:
    """The pictures of stage crossing, if any: of several lasers in a folder for each."""
    places = [crossing, *(crossing / name for name in lasers)]
    held = any(place.is_dir() and holds_pictures(place) for place in places)
    return _pictured(crossing, lasers) if held else []


def _crossing_kept(folder: Path, described: RigFile) -> TargetViews:
    """The views of stage crossing that are in ``points.csv`` already."""
    path = folder / POINTS
    if path.exists() and b"crossing" in read_bytes(path, TEXT_LIMIT_BYTES):
        return read_points(path, described.target, described.lasers).crossing
    return no_views(len(described.target.markers_mm) + len(described.lasers))


def _detected(folder: Path, described: RigFile, run: Execution) -> Detection:
    views, missed = {}, []
    size = described.image_size
    for stage, pictured in _stage_folders(folder, described.lasers).items():
        search = partial(_searched, target=described.target)
        files = [picture.file for picture in pictured]
        found = list(spread(search, files, f"detect {stage}", run))
        for file, (picture_size, _) in zip(files, found, strict=True):
            size = size or picture_size
            _refuse_other_size(file.path.relative_to(folder), picture_size, size)
        outcomes = [outcome for _, outcome in found]
        views[stage] = _stage_views(stage, pictured, outcomes, described.target)
        missed += [
            Missed(stage, picture.view, outcome.reason)
            for picture, outcome in zip(pictured, outcomes, strict=True)
            if outcome.sighting is None
        ]
    crossing, lost, size = _crossing(folder, described, size, run)
    missed += lost
    empty = no_views(len(described.target.markers_mm))
    observations = Observations(views.get("camera", empty), views.get("plane", empty), crossing)
    rig = described.rig(observations, picture_size=size)
    check_views(rig)
    return Detection(rig, tuple(missed))


def _searched(file: PictureFile, target: CollinearTarget) -> tuple[tuple[int, int], TargetSearch]:
    """Size of the picture without laser, where there is one, and what it shows."""
    picture = read_picture(file.path)
    _refuse_unlike_pair(file, _size(picture))
    return _size(picture), find_target(picture, target)


def _refuse_unlike_pair(file: PictureFile, off: tuple[int, int]) -> None:
    """The target is searched for in the picture without laser; the other is of the same view."""
    if file.laser_on is None:
        return
    on = _size(read_picture(file.laser_on))
    if on != off:
        raise InputError(
            f"{file_name(file.laser_on)} has {on[0]}×{on[1]} pixels, {file.path.name} has "
            f"{off[0]}×{off[1]}",
            "give both pictures of a pair from one camera, uncropped",
        )


def _size(picture: np.ndarray) -> tuple[int, int]:
    height, width = picture.shape[:2]
    return width, height


def _refuse_other_size(picture: Path, found: tuple[int, int], expected: tuple[int, int]) -> None:
    if found != expected:
        raise InputError(
            f"{file_name(picture)} has {found[0]}×{found[1]} pixels, the rig's pictures have "
            f"{expected[0]}×{expected[1]}",
            "remove it, or correct image_size in rig.toml; all pictures must come from one "
            "camera, uncropped",
        )


def _stage_views(
    stage: str,
    pictured: list[_Pictured],
    outcomes: list[TargetSearch],
    target: CollinearTarget,
) -> TargetViews:
    seen = [
        (picture, outcome.sighting)
        for picture, outcome in zip(pictured, outcomes, strict=True)
        if outcome.sighting is not None
    ]
    if not seen:
        raise UntrustworthyError(
            stage,
            f"the target was seen in none of {len(pictured)} pictures; "
            f"{pictured[0].file.path.name}: {outcomes[0].reason}",
            f"check marker ({target.marker}) and marker_size_mm in rig.toml, focus and light",
        )
    sightings = [sighting for _, sighting in seen]
    if stage == "camera":
        sightings = order_by_fixed_end(sightings)
    return TargetViews(
        tuple(picture.view for picture, _ in seen),
        np.stack([sighting.uv for sighting in sightings]),
        np.stack([sighting.std for sighting in sightings]),
        np.array([picture.laser for picture, _ in seen]),
    )
