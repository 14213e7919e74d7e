"""A rig folder read: what is known of the rig, and what its pictures show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.imaging.markers import TargetSighting, find_target, order_by_fixed_end
from sheetoflight.io.check_views import check_views
from sheetoflight.io.pictures import PictureFile, holds_pictures, list_pictures, read_picture
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.io.quoting import file_name
from sheetoflight.io.reading import TEXT_LIMIT_BYTES, read_bytes
from sheetoflight.io.rig_toml import RigFile, read_rig_toml
from sheetoflight.model.board import Board
from sheetoflight.model.observations import Observations, TargetViews, no_views
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.boards import BoardPicture, board_views, searched_board
from sheetoflight.workflow.crossings import Crossing, crossing_views, searched_crossing
from sheetoflight.workflow.spread import ALONE, Execution, spread
from sheetoflight.workflow.stage_pictures import (
    Pictured,
    held_pictures,
    pictured,
    refuse_other_size,
    refuse_unlike_pair,
    size_of,
)

STAGES = ("camera", "plane")
"""Stages in whose pictures the target is searched for."""

BOARDS_WITHOUT_LINE = "boards without line"
"""What pictures in camera/ are where there is no collinear target."""

POINTS = "points.csv"


@dataclass(frozen=True)
class Missed:
    """A picture in which the target was not found, and why."""

    stage: str
    view: str
    reason: str

    @property
    def in_words(self) -> str:
        """``STAGE/VIEW: why``."""
        return f"{self.stage}/{self.view}: {self.reason}"


@dataclass(frozen=True)
class Detection:
    """What a rig folder shows.

    Parameters
    ----------
    rig : Rig
        With its observations.
    missed : tuple of Missed
        Of the pictures that were searched.
    kept : tuple of str
        Stages that were taken from ``points.csv``, having no pictures.
    """

    rig: Rig
    missed: tuple[Missed, ...]
    kept: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found:
    """What one picture of a collinear target shows."""

    size: tuple[int, int]
    sighting: TargetSighting | None
    reason: str

    @property
    def seen(self) -> bool:
        """Whether the target was found."""
        return self.sighting is not None


def load_rig(folder: str | Path, run: Execution = ALONE) -> Rig:
    """Read a rig folder: ``rig.toml``, and ``points.csv`` or else the pictures.

    Raises
    ------
    FileError, InputError, UntrustworthyError
        As for `read_rig_folder`.
    """
    return read_rig_folder(folder, run).rig


def read_rig_folder(folder: str | Path, run: Execution = ALONE) -> Detection:
    """Read a rig folder, and tell in which pictures nothing was found.

    With ``points.csv`` no picture is searched.

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
        return _detected(folder, described, run)
    observations = _given(folder, described)
    rig = described.rig(observations, picture_size=_first_picture_size(folder, described))
    check_views(rig)
    return Detection(rig, ())


def detect(folder: str | Path, run: Execution = ALONE) -> Detection:
    """Find the target in all pictures of a rig folder and write ``points.csv``.

    What ``points.csv`` held of the stages crossing, board and match stays in it where there are no
    pictures of them.

    Raises
    ------
    FileError, InputError
        If the folder, a file or a picture cannot be used; the message names it.
    UntrustworthyError
        If no picture of a stage shows the target, or the laser's spot on it.
    """
    folder = Path(folder)
    detection = _detected(folder, _described(folder), run)
    rig = detection.rig
    write_points(folder / POINTS, rig.observations, rig.lasers, rig.board)
    return detection


def _described(folder: Path) -> RigFile:
    if not folder.is_dir():
        raise FileError(
            f"{folder} is no folder", "name a rig folder, that is one with a rig.toml in it"
        )
    return read_rig_toml(folder / "rig.toml")


_OPTIONAL = ("crossing", "board")
"""Stages that ``points.csv`` may give where there are no pictures of them."""


_MATCHED = {"match": "matches"}
"""The stage that has no pictures of its own, and where observations hold it."""


def _given(folder: Path, described: RigFile) -> Observations:
    return read_points(folder / POINTS, described.target, described.lasers, described.board)


def _stage_pictures(folder: Path, described: RigFile) -> dict[str, list[Pictured]]:
    """The pictures of each stage that has any.

    Without a collinear target, pictures in camera/ are of the board with the laser off.
    """
    lasers = described.lasers
    described.refuse_without_target()
    found = {}
    for stage in STAGES:
        if not (folder / stage).is_dir():
            continue
        if described.target is None and stage == "plane":
            raise InputError(
                f"{file_name(folder / stage)} holds pictures, but rig.toml has no [target]",
                "describe the target there, or move pictures of the board into board/",
            )
        found[stage] = pictured(folder / stage, lasers if stage == "plane" else ())
    for stage in _OPTIONAL:
        pictures = held_pictures(folder / stage, lasers)
        if pictures and (described.board if stage == "board" else described.target) is None:
            table = "[board]" if stage == "board" else "[target]"
            raise InputError(
                f"{file_name(folder / stage)} holds pictures, but rig.toml has no {table}",
                f"add {table}, or move the folder away",
            )
        if pictures:
            found[stage] = pictures
    if found:
        return found
    raise InputError(
        f"{folder} holds neither {POINTS} nor a folder {', '.join(STAGES)} or board with pictures",
        "put the pictures of the pivoting target into camera/, those of the target in the "
        "sheet of light into plane/, those of a board with the laser line across it into board/",
    )


def _first_picture_size(folder: Path, described: RigFile) -> tuple[int, int] | None:
    """Size of some picture, where the rig file leaves it open."""
    if described.image_size:
        return None
    stages = ("camera", "plane", *_OPTIONAL)
    sheets = [f"{stage}/{name}" for stage in stages for name in described.lasers]
    for place in (*stages, *sheets):
        if (folder / place).is_dir() and holds_pictures(folder / place):
            return size_of(read_picture(list_pictures(folder / place)[0].path))
    return None


@dataclass(frozen=True)
class _Search:
    """What is searched for in the pictures of one stage: importable, for other processes."""

    stage: str
    target: CollinearTarget
    board: Board | None

    def __call__(self, file: PictureFile) -> Found | Crossing | BoardPicture:
        refuse_unlike_pair(file)
        if self.stage == "crossing":
            return searched_crossing(file, self.target)
        if self.board is not None and self.stage in ("board", BOARDS_WITHOUT_LINE):
            return searched_board(file, self.board, self.stage == "board")
        picture = read_picture(file.path)
        search = find_target(picture, self.target)
        return Found(size_of(picture), search.sighting, search.reason)


def _detected(folder: Path, described: RigFile, run: Execution) -> Detection:
    size, missed = described.image_size, []
    found: dict[str, list[tuple[Pictured, Any]]] = {}
    for stage, pictures in _stage_pictures(folder, described).items():
        what = BOARDS_WITHOUT_LINE if stage == "camera" and described.target is None else stage
        search = _Search(what, described.rod, described.board)
        files = [picture.file for picture in pictures]
        outcomes = list(spread(search, files, f"detect {stage}", run))
        for file, outcome in zip(files, outcomes, strict=True):
            size = size or outcome.size
            refuse_other_size(file.path.relative_to(folder), outcome.size, size)
        pairs = list(zip(pictures, outcomes, strict=True))
        missed += [Missed(stage, p.view, o.reason) for p, o in pairs if not o.seen]
        _refuse_none_seen(stage, pairs, described)
        found[what] = pairs
    observations, kept = _observations(folder, described, found)
    rig = described.rig(observations, picture_size=size)
    check_views(rig)
    return Detection(rig, tuple(missed), kept)


def _observations(
    folder: Path, described: RigFile, found: Mapping[str, list[tuple[Pictured, Any]]]
) -> tuple[Observations, tuple[str, ...]]:
    """What was found, stage by stage, and which stages were taken from ``points.csv``."""
    markers, lasers = len(described.rod.markers_mm), len(described.lasers)
    views: dict[str, Any] = {}
    for stage in STAGES:
        if stage in found:
            views[stage] = _stage_views(stage, found[stage])
    if "crossing" in found:
        names, own, outcomes = _columns(found["crossing"])
        views["crossing"] = crossing_views(names, own, outcomes, lasers)
    boards = [*found.get("board", ()), *found.get(BOARDS_WITHOUT_LINE, ())]
    if boards:
        names, own, outcomes = _columns(boards)
        camera = {p.file.path for p, _ in found.get(BOARDS_WITHOUT_LINE, ())}
        told = [f"camera/{p.view}" if p.file.path in camera else p.view for p, _ in boards]
        views["board"] = board_views(told, own, outcomes)
    missing = [stage for stage in (*_OPTIONAL, *_MATCHED) if stage not in views]
    kept = ()
    if (folder / POINTS).exists() and missing:
        text = read_bytes(folder / POINTS, TEXT_LIMIT_BYTES)
        kept = tuple(stage for stage in missing if stage.encode() in text)
        given = _given(folder, described) if kept else Observations()
        fields = {stage: _MATCHED.get(stage, stage) for stage in kept}
        fields = {stage: name for stage, name in fields.items() if len(getattr(given, name))}
        views |= {name: getattr(given, name) for name in fields.values()}
        kept = tuple(fields)
    empty: dict[str, Any] = {stage: no_views(markers) for stage in STAGES}
    empty["crossing"] = no_views(markers + lasers)
    return Observations(**(empty | views)), kept


def _columns(
    pairs: Sequence[tuple[Pictured, Any]],
) -> tuple[list[str], list[int], list[Any]]:
    pictures = [picture for picture, _ in pairs]
    return [p.view for p in pictures], [p.laser for p in pictures], [o for _, o in pairs]


_NOT_SEEN = {
    "camera": "check marker ({marker}) and marker_size_mm in rig.toml, focus and light",
    "plane": "check marker ({marker}) and marker_size_mm in rig.toml, focus and light",
    "crossing": "check that the laser is on and its sheet crosses the target between markers",
    "board": "check kind, columns and rows under [board] in rig.toml, focus and light",
}


def _refuse_none_seen(
    stage: str, pairs: Sequence[tuple[Pictured, Any]], described: RigFile
) -> None:
    if any(outcome.seen for _, outcome in pairs):
        return
    boards = stage == "board" or described.target is None
    what = {"crossing": "the laser's spot on the target"}.get(stage, "the target")
    picture, outcome = pairs[0]
    raise UntrustworthyError(
        stage,
        f"{'the board' if boards else what} was seen in none of {len(pairs)} pictures; "
        f"{picture.file.path.name}: {outcome.reason}",
        _NOT_SEEN["board" if boards else stage].format(marker=described.rod.marker),
    )


def _stage_views(stage: str, pairs: Sequence[tuple[Pictured, Found]]) -> TargetViews:
    seen = [(p, o.sighting) for p, o in pairs if o.sighting is not None]
    sightings = [sighting for _, sighting in seen]
    if stage == "camera":
        sightings = order_by_fixed_end(sightings)
    return TargetViews(
        tuple(picture.view for picture, _ in seen),
        np.stack([sighting.uv for sighting in sightings]),
        np.stack([sighting.std for sighting in sightings]),
        np.array([picture.laser for picture, _ in seen]),
    )
