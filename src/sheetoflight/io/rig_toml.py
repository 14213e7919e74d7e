"""``rig.toml``: what is known of a rig before anything is observed."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.quoting import file_name, one_line
from sheetoflight.io.reading import naming, read_text
from sheetoflight.io.schema import StrictModel, validated
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget, MarkerKind

_LIMIT_BYTES = 1024 * 1024

_Positive = Annotated[float, Field(gt=0)]
_Pixels = Annotated[int, Field(ge=1, le=1_000_000)]
_Count = Annotated[int, Field(ge=2, le=1000)]


class _Target(StrictModel):
    kind: Literal["collinear"] = "collinear"
    markers_mm: list[float]
    tolerance_mm: float = CollinearTarget.tolerance_mm
    marker: MarkerKind = CollinearTarget.marker
    marker_size_mm: float = CollinearTarget.marker_size_mm


class _Board(StrictModel):
    kind: Literal["chessboard", "circles", "charuco"]
    columns: _Count
    rows: _Count
    pitch_mm: Annotated[list[_Positive], Field(min_length=2, max_length=2)]


class _Camera(StrictModel):
    image_size: Annotated[list[_Pixels], Field(min_length=2, max_length=2)] | None = None
    distortion: Literal["none", "radial1", "radial2", "brown"] = "none"
    skew: bool = Rig.skew


class _Noise(StrictModel):
    pixel_std: _Positive | None = None


class _RigDocument(StrictModel):
    target: _Target
    board: _Board | None = None
    camera: _Camera = _Camera()
    noise: _Noise = _Noise()


@dataclass(frozen=True)
class RigFile:
    """The content of a ``rig.toml``, before there are observations.

    Parameters
    ----------
    target : CollinearTarget
    image_size : (int, int) or None
        Width and height in px; None where the file leaves it to the pictures.
    distortion : {"none", "radial1", "radial2", "brown"}
    skew : bool
    pixel_std : float or None
        Standard uncertainty of an image coordinate in px; None where it is to be estimated.
    path : str
        The file it was read from.
    """

    target: CollinearTarget
    image_size: tuple[int, int] | None
    distortion: str
    skew: bool
    pixel_std: float | None
    path: str

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
            target=self.target,
            image_size=size,
            distortion=self.distortion,
            skew=self.skew,
            pixel_std=self.pixel_std,
            observations=observations or Observations(),
            source=self.path,
        )


def read_rig_toml(path: str | Path) -> RigFile:
    """What ``rig.toml`` says of a rig.

    A ``[board]`` is checked, and not used further: no method adjusts boards.

    Raises
    ------
    InputError
        For an unknown or missing key, a wrong type or value; file and key are named.
    FileError
        If the file cannot be read, or is not TOML; the line is named.
    """
    document = _parsed(path)
    with naming(path):
        content = validated(_RigDocument, document)
        target, camera = content.target, content.camera
        return RigFile(
            target=CollinearTarget(
                tuple(target.markers_mm), target.tolerance_mm, target.marker, target.marker_size_mm
            ),
            image_size=(camera.image_size[0], camera.image_size[1]) if camera.image_size else None,
            distortion=camera.distortion,
            skew=camera.skew,
            pixel_std=content.noise.pixel_std,
            path=str(path),
        )


def rig_toml_text(rig: Rig) -> str:
    """A rig as the text of ``rig.toml``, without its observations; numbers come back exactly."""
    target = rig.target
    lines = [
        "[target]",
        'kind = "collinear"',
        f"markers_mm = {list(target.markers_mm)}",
        f"tolerance_mm = {float(target.tolerance_mm)!r}",
        f'marker = "{target.marker}"',
        f"marker_size_mm = {float(target.marker_size_mm)!r}",
        "",
        "[camera]",
        f"image_size = {[int(n) for n in rig.image_size]}",
        f'distortion = "{rig.distortion}"',
        f"skew = {'true' if rig.skew else 'false'}",
    ]
    if rig.pixel_std is not None:
        lines += ["", "[noise]", f"pixel_std = {float(rig.pixel_std)!r}"]
    return "\n".join(lines) + "\n"


def write_rig_toml(path: str | Path, rig: Rig) -> None:
    """Write ``rig.toml``, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_whole(path, rig_toml_text(rig))


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
