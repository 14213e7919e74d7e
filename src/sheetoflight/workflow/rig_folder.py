"""A rig folder read: what is known of the rig, and what its pictures show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.imaging.markers import TargetSearch, find_target, order_by_fixed_end
from sheetoflight.io.check_views import check_target_views
from sheetoflight.io.pictures import PictureFile, list_pictures, read_picture
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.io.rig_toml import RigFile, read_rig_toml
from sheetoflight.model.observations import Observations, TargetViews, no_views
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.spread import ALONE, Execution, spread

STAGES = ("camera", "plane")
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
        If no picture of a stage shows the target.
    """
    folder = Path(folder)
    described = _described(folder)
    if not (folder / POINTS).exists():
        return _detected(folder, described, run).rig
    observations = read_points(folder / POINTS, described.target)
    rig = described.rig(observations, picture_size=_first_picture_size(folder, described))
    _check(rig)
    return rig


def detect(folder: str | Path, run: Execution = ALONE) -> Detection:
    """Find the target in all pictures of a rig folder and write ``points.csv``.

    Raises
    ------
    FileError, InputError
        If the folder, a file or a picture cannot be used; the message names it.
    UntrustworthyError
        If no picture of a stage shows the target.
    """
    folder = Path(folder)
    detection = _detected(folder, _described(folder), run)
    write_points(folder / POINTS, detection.rig.observations)
    return detection


def _described(folder: Path) -> RigFile:
    if not folder.is_dir():
        raise FileError(
            f"{folder} is no folder", "name a rig folder, that is one with a rig.toml in it"
        )
    return read_rig_toml(folder / "rig.toml")


def _stage_folders(folder: Path) -> dict[str, list[PictureFile]]:
    found = {stage: list_pictures(folder / stage) for stage in STAGES if (folder / stage).is_dir()}
    if not found:
        raise InputError(
            f"{folder} holds neither {POINTS} nor a folder {' or '.join(STAGES)} with pictures",
            "put the pictures of the pivoting target into camera/, those of the target in the "
            "sheet of light into plane/",
        )
    return found


def _first_picture_size(folder: Path, described: RigFile) -> tuple[int, int] | None:
    """Size of some picture, where the rig file leaves it open."""
    if described.image_size or not any((folder / stage).is_dir() for stage in STAGES):
        return None
    first = next(iter(_stage_folders(folder).values()))[0]
    return _size(read_picture(first.path))


def _detected(folder: Path, described: RigFile, run: Execution) -> Detection:
    views, missed = {}, []
    size = described.image_size
    for stage, files in _stage_folders(folder).items():
        search = partial(_searched, target=described.target)
        found = list(spread(search, files, f"detect {stage}", run))
        for file, (picture_size, _) in zip(files, found, strict=True):
            size = size or picture_size
            _refuse_other_size(file, stage, picture_size, size)
        outcomes = [outcome for _, outcome in found]
        views[stage] = _stage_views(stage, files, outcomes, described.target)
        missed += [
            Missed(stage, file.name, outcome.reason)
            for file, outcome in zip(files, outcomes, strict=True)
            if outcome.sighting is None
        ]
    empty = no_views(len(described.target.markers_mm))
    observations = Observations(views.get("camera", empty), views.get("plane", empty))
    rig = described.rig(observations, picture_size=size)
    _check(rig)
    return Detection(rig, tuple(missed))


def _searched(file: PictureFile, target: CollinearTarget) -> tuple[tuple[int, int], TargetSearch]:
    """Size of the picture without laser, where there is one, and what it shows."""
    picture = read_picture(file.path)
    return _size(picture), find_target(picture, target)


def _size(picture: np.ndarray) -> tuple[int, int]:
    height, width = picture.shape[:2]
    return width, height


def _refuse_other_size(
    file: PictureFile, stage: str, found: tuple[int, int], expected: tuple[int, int]
) -> None:
    if found != expected:
        raise InputError(
            f"{stage}/{file.path.name} has {found[0]}×{found[1]} pixels, the rig's pictures have "
            f"{expected[0]}×{expected[1]}",
            "remove it, or correct image_size in rig.toml; all pictures must come from one "
            "camera, uncropped",
        )


def _stage_views(
    stage: str,
    files: list[PictureFile],
    outcomes: list[TargetSearch],
    target: CollinearTarget,
) -> TargetViews:
    seen = [
        (file.name, outcome.sighting)
        for file, outcome in zip(files, outcomes, strict=True)
        if outcome.sighting is not None
    ]
    if not seen:
        raise UntrustworthyError(
            stage,
            f"the target was seen in none of {len(files)} pictures; "
            f"{files[0].path.name}: {outcomes[0].reason}",
            f"check marker ({target.marker}) and marker_size_mm in rig.toml, focus and light",
        )
    sightings = [sighting for _, sighting in seen]
    if stage == "camera":
        sightings = order_by_fixed_end(sightings)
    return TargetViews(
        tuple(name for name, _ in seen),
        np.stack([sighting.uv for sighting in sightings]),
        np.stack([sighting.std for sighting in sightings]),
    )


def _check(rig: Rig) -> None:
    for stage, views in rig.observations.stages().items():
        check_target_views(views, stage, rig.image_size)
