"""``rig.toml``: what is known of a rig before anything is observed."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.plan_table import PlanTable, SheetTable, planned_geometry
from sheetoflight.io.quoting import file_name, one_line, shown
from sheetoflight.io.reading import naming, read_text
from sheetoflight.io.schema import StrictModel, validated
from sheetoflight.model.board import Board, BoardKind, PlanarBoard, SolidTarget
from sheetoflight.model.nominal import NominalGeometry
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget, MarkerKind

_LIMIT_BYTES = 1024 * 1024
_LONGEST_NAME = 60
_TEMPERATURE = ("expansion_per_K", "warmer_by_K", "warmer_by_std_K", "expansion_std_per_K")

_Positive = Annotated[float, Field(gt=0)]
_NotNegative = Annotated[float, Field(ge=0)]
_Pixels = Annotated[int, Field(ge=1, le=1_000_000)]
_Count = Annotated[int, Field(ge=2, le=1000)]


class _Target(StrictModel):
    kind: Literal["collinear"] = "collinear"
    markers_mm: list[float]
    tolerance_mm: float = CollinearTarget.tolerance_mm
    marker: MarkerKind = CollinearTarget.marker
    marker_size_mm: float = CollinearTarget.marker_size_mm
    expansion_per_K: float = CollinearTarget.expansion_per_K
    warmer_by_K: float = CollinearTarget.warmer_by_K
    warmer_by_std_K: float = CollinearTarget.warmer_by_std_K
    expansion_std_per_K: float = CollinearTarget.expansion_std_per_K


class _Uncertain(StrictModel):
    scale_std: _NotNegative = PlanarBoard.scale_std
    tolerance_mm: _NotNegative | None = PlanarBoard.tolerance_mm


class _PlanarBoard(_Uncertain):
    kind: BoardKind
    columns: _Count
    rows: _Count
    pitch_mm: Annotated[list[_Positive], Field(min_length=2, max_length=2)]
    staggered: bool = PlanarBoard.staggered
    circle_mm: _Positive | None = PlanarBoard.circle_mm
    dictionary: str = PlanarBoard.dictionary
    marker_mm: _Positive | None = PlanarBoard.marker_mm


class _SolidTarget(_Uncertain):
    kind: Literal["solid"]
    points_mm: list[Annotated[list[float], Field(min_length=3, max_length=3)]]
    faces: list[list[int]] = Field(default_factory=list)


class _Camera(StrictModel):
    image_size: Annotated[list[_Pixels], Field(min_length=2, max_length=2)] | None = None
    distortion: Literal["none", "radial1", "radial2", "brown"] | None = None
    skew: bool = Rig.skew


class _Laser(SheetTable):
    name: str


class _Noise(StrictModel):
    pixel_std: _Positive | None = None
    placement_std_mm: _NotNegative | None = None


class _RigDocument(StrictModel):
    target: _Target | None = None
    board: _PlanarBoard | None = None
    camera: _Camera = _Camera()
    laser: Annotated[list[_Laser], Field(min_length=1)] = Field(
        default_factory=lambda: [_Laser(name=name) for name in Rig.lasers]
    )
    noise: _Noise = _Noise()
    plan: PlanTable | None = None


class _SolidRigDocument(_RigDocument):
    board: _SolidTarget  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]


@dataclass(frozen=True)
class RigFile:
    """The content of a ``rig.toml``, before there are observations.

    Parameters
    ----------
    target : CollinearTarget or None
        None where there is a board alone, or neither.
    image_size : (int, int) or None
        Width and height in px; None where the file leaves it to the pictures.
    distortion : {"none", "radial1", "radial2", "brown"}
    skew : bool
    pixel_std : float or None
        Standard uncertainty of an image coordinate in px; None where it is to be estimated.
    placement_std : float or None
        How far the ends of a target laid into the sheet lie off it, as a standard deviation in
        mm; None where it is to be estimated.
    lasers : tuple of str
        Names of the sheets of light.
    path : str
        The file it was read from.
    plan : NominalGeometry or None
        How the rig is meant to be built; None where the file does not say.
    board : PlanarBoard, SolidTarget or None
        What stage board shows.
    """

    target: CollinearTarget | None
    image_size: tuple[int, int] | None
    distortion: str
    skew: bool
    pixel_std: float | None
    placement_std: float | None
    lasers: tuple[str, ...]
    path: str
    plan: NominalGeometry | None = None
    board: Board | None = None

    @property
    def rod(self) -> CollinearTarget:
        """The collinear target; an ordinary one where there is none, for stages without views."""
        return self.target or CollinearTarget()

    def refuse_without_target(self) -> None:
        """Refuse a file that describes nothing to look for in pictures.

        Raises
        ------
        InputError
            If there is neither a target nor a board.
        """
        if self.target is None and self.board is None:
            raise InputError(
                f"{file_name(self.path)}: neither [target] nor [board] is there",
                "describe the target with markers_mm, or the board with kind, columns, rows and "
                "pitch_mm; only matched points, or places in the sheet, in points.csv need neither",
            )

    def rig(
        self, observations: Observations | None = None, picture_size: tuple[int, int] | None = None
    ) -> Rig:
        """The rig with what was observed.

        Parameters
        ----------
        observations : Observations, optional
        picture_size : (int, int), optional
            Width and height of the rig's pictures in px, where there are pictures.

        Raises
        ------
        InputError
            If neither the file nor the pictures say the picture size, or they disagree.
        """
        stated = self.image_size
        if stated and picture_size and tuple(picture_size) != stated:
            raise InputError(
                f"{file_name(self.path)}: image_size is {list(stated)}, but the pictures have "
                f"{picture_size[0]} × {picture_size[1]} px",
                "correct image_size, or leave it out",
            )
        size = stated or picture_size
        if size is None:
            raise InputError(
                f"{file_name(self.path)}: 'image_size' is missing in [camera], and there is no "
                "picture to take it from",
                "add image_size = [width, height]",
            )
        return Rig(
            target=self.rod,
            image_size=size,
            distortion=self.distortion,
            skew=self.skew,
            pixel_std=self.pixel_std,
            placement_std=self.placement_std,
            lasers=self.lasers,
            board=self.board,
            observations=observations or Observations(),
            source=self.path,
        )


def read_rig_toml(path: str | Path) -> RigFile:
    """What ``rig.toml`` says of a rig.

    The distortion of the lens, where the file does not say, is ``brown`` with a board, whose many
    points show it, and ``none`` without.

    Raises
    ------
    InputError
        For an unknown or missing key, a wrong type or value, a thermal expansion without the
        uncertainty of the temperature; file and key are named.
    FileError
        If the file cannot be read, or is not TOML; the line is named.
    """
    document = _parsed(path)
    with naming(path):
        content = validated(_document_model(document), document)
        camera, noise = content.camera, content.noise
        return RigFile(
            target=None if content.target is None else _target(content.target),
            image_size=(camera.image_size[0], camera.image_size[1]) if camera.image_size else None,
            distortion=camera.distortion or ("brown" if content.board else Rig.distortion),
            skew=camera.skew,
            pixel_std=noise.pixel_std,
            placement_std=noise.placement_std_mm,
            lasers=_laser_names([laser.name for laser in content.laser]),
            path=str(path),
            plan=planned_geometry(content.plan, [(laser.name, laser) for laser in content.laser]),
            board=None if content.board is None else _board(content.board),
        )


def rig_toml_text(rig: Rig) -> str:
    """A rig as the text of ``rig.toml``, without its observations; numbers come back exactly.

    Raises
    ------
    InputError
        If a laser's name is none that a rig file may hold.
    """
    seen = rig.observations
    others = rig.board is not None or len(seen.matches) > 0 or len(seen.board) > 0
    no_target = others and not rig.observations.stages()
    lines = [
        *([] if no_target else _target_lines(rig.target)),
        *([] if rig.board is None else _board_lines(rig.board)),
        "[camera]",
        f"image_size = {[int(n) for n in rig.image_size]}",
        f'distortion = "{rig.distortion}"',
        f"skew = {'true' if rig.skew else 'false'}",
    ]
    if rig.lasers != Rig.lasers:
        for name in _laser_names(rig.lasers):
            lines += ["", "[[laser]]", f"name = {json.dumps(name, ensure_ascii=False)}"]
    noise = {"pixel_std": rig.pixel_std, "placement_std_mm": rig.placement_std}
    stated = [f"{key} = {float(std)!r}" for key, std in noise.items() if std is not None]
    if stated:
        lines += ["", "[noise]", *stated]
    return "\n".join(lines) + "\n"


def _document_model(document: dict[str, Any]) -> type[_RigDocument]:
    """What describes the file: a solid body has other keys than a board."""
    board = document.get("board")
    solid = isinstance(board, dict) and board.get("kind") == "solid"
    return _SolidRigDocument if solid else _RigDocument


def _target_lines(target: CollinearTarget) -> list[str]:
    return [
        "[target]",
        'kind = "collinear"',
        f"markers_mm = {list(target.markers_mm)}",
        f"tolerance_mm = {float(target.tolerance_mm)!r}",
        f'marker = "{target.marker}"',
        f"marker_size_mm = {float(target.marker_size_mm)!r}",
        *_temperature_lines(target),
        "",
    ]


def write_rig_toml(path: str | Path, rig: Rig) -> None:
    """Write ``rig.toml``, whole or not at all.

    Raises
    ------
    InputError
        As `rig_toml_text`.
    FileError
        If the file cannot be written.
    """
    with naming(path):
        text = rig_toml_text(rig)
    write_whole(path, text)


def _target(part: _Target) -> CollinearTarget:
    given = part.model_fields_set.intersection(_TEMPERATURE)
    if given and "expansion_per_K" not in given:
        raise InputError(
            f"target: {min(given)} is given without expansion_per_K",
            "add it, a relative change of length per kelvin: 11.5e-6 for steel",
        )
    if given and "warmer_by_std_K" not in given:
        raise InputError(
            "target: expansion_per_K is given without warmer_by_std_K",
            "say how well warmer_by_K, the target's temperature in the pictures less that at "
            "which it was measured, is known, as a standard uncertainty in kelvin",
        )
    return CollinearTarget(**part.model_dump(exclude={"kind"}))


def _board(part: _PlanarBoard | _SolidTarget) -> Board:
    if isinstance(part, _SolidTarget):
        return SolidTarget(np.array(part.points_mm), part.faces, part.scale_std, part.tolerance_mm)
    return PlanarBoard(
        **part.model_dump(exclude={"pitch_mm"}), pitch_mm=(part.pitch_mm[0], part.pitch_mm[1])
    )


def _board_lines(board: Board) -> list[str]:
    """``[board]``, what has its default left out."""
    if isinstance(board, PlanarBoard):
        values: dict[str, Any] = asdict(board) | {"pitch_mm": list(board.pitch_mm)}
        plain = {field.name: field.default for field in fields(PlanarBoard)}
    else:
        faces = [list(face) for face in board.face_points]
        values = {"kind": "solid", "points_mm": board.points.tolist(), "faces": faces}
        values |= {"scale_std": board.scale_std, "tolerance_mm": board.tolerance_mm}
        plain = {"scale_std": 0.0, "tolerance_mm": None}
    stated = {
        key: value for key, value in values.items() if key not in plain or value != plain[key]
    }
    return ["[board]", *(f"{key} = {_toml(value)}" for key, value in stated.items()), ""]


def _toml(value: object) -> str:
    """A value as TOML has it: JSON's text serves for text, numbers, truth values and lists."""
    return json.dumps(value, ensure_ascii=False)


def _temperature_lines(target: CollinearTarget) -> list[str]:
    values = {name: float(getattr(target, name)) for name in _TEMPERATURE}
    return [f"{name} = {value!r}" for name, value in values.items()] if any(values.values()) else []


def _laser_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, checked to be fit for a folder and for the parameters of a covariance."""
    for index, name in enumerate(names):
        text = name.isprintable() and name == name.strip() and 0 < len(name) <= _LONGEST_NAME
        if not text or "/" in name or name.startswith(".") or name == "camera":
            raise InputError(
                f"laser[{index}].name is {shown(name)}, expected a word of up to {_LONGEST_NAME} "
                "letters that names a folder, other than camera",
                "choose a plain name, such as left",
            )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two lasers are called {shown(twice)}", "give each a name of its own")
    return tuple(names)


def _parsed(path: str | Path) -> dict[str, Any]:
    text, name = read_text(path, _LIMIT_BYTES), file_name(path)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(
            f"{name} is not TOML: {one_line(str(error), 200)}",
            "correct the line, or quote the text",
        ) from error
    except RecursionError as error:
        raise FileError(f"{name} is nested too deeply", "write it again") from error
    except ValueError as error:
        raise FileError(
            f"{name} holds a number or date that cannot be ({one_line(str(error), 200)})",
            "correct it",
        ) from error
