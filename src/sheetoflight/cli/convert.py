"""``sol convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sheetoflight.cli.telling import AsJson, refuse_to_overwrite, tell, tell_json, warn
from sheetoflight.errors import InputError
from sheetoflight.io.calibration_json import read_calibration, write_calibration
from sheetoflight.io.exchange import (
    Corners,
    Exchanged,
    exchange_format,
    is_calibration,
    read_corners,
    read_exchange,
    write_corners,
    write_exchange,
)
from sheetoflight.io.quoting import file_name
from sheetoflight.model.calibration import Calibration

Format = Literal["opencv", "ros", "kalibr", "halcon", "bouguet"]

_OURS = "calibration.json"
_POINTS = "points.csv"


def convert(
    input: Path,  # noqa: A002 – the help calls it INPUT
    output: Path,
    /,
    *,
    to: Format | None = None,
    image_size: tuple[int, int] | None = None,
    camera: str | None = None,
    pose: Path | None = None,
    pixel_um: float = 5.0,
    pixel_std: Annotated[float | None, Parameter(name="--pixel-std")] = None,
    json: AsJson = False,
) -> None:
    """Camera and light planes from and to the files of other tools.

    Parameters
    ----------
    input
        A calibration.json, or a camera file of OpenCV, ROS, Kalibr, HALCON or Bouguet's toolbox;
        which of them it is, its content tells.
    output
        Where to write. Its ending names the format where only one has it: .xml opencv,
        .mat bouguet, .dat halcon, .json a calibration.json. .csv: a points.csv with the corners
        that Bouguet's toolbox keeps in calib_data.mat; what rig.toml needs beside it is told.
    to
        The format to write, where the ending .yaml or .yml leaves it open, or .json means OpenCV's.
    image_size
        Width and height of the pictures in px, where the input does not say it.
    camera
        Which camera is meant where the input holds several: cam1, or 2 for M2 and D2.
    pose
        A HALCON pose file with the light plane, beside a HALCON camera file.
    pixel_um
        Width of a pixel in µm, to write HALCON's Sx.
    pixel_std
        Standard uncertainty of an image point in px, to write a calibration.json: no other file
        states it. 0.1 suits well-lit markers.
    json
        Print format and notes as JSON.
    """
    refuse_to_overwrite(output, [input, *([pose] if pose else [])])
    if to is None and output.suffix.lower() == ".csv":
        if any(choice is not None for choice in (image_size, camera, pose, pixel_std)):
            raise InputError(
                f"a {_POINTS} holds corners, and no camera",
                "leave --image-size, --camera, --pose and --pixel-std out",
            )
        _convert_corners(input, output, json)
        return
    ours = is_calibration(input)
    target = _target(output, to, ours)
    if ours:
        _refuse_choices(image_size, camera, pose)
        source, came_from, notes = read_calibration(input), _OURS, ()
    else:
        source = read_exchange(input, image_size=image_size, camera=camera, pose=pose)
        came_from, notes = source.format, source.notes
    if target == _OURS:
        notes += _written_as_ours(output, source, pixel_std, input)
    else:
        notes += write_exchange(output, source, target, pixel_um=pixel_um)
    _report(output, came_from, target, notes, json)


def _target(output: Path, to: Format | None, ours: bool) -> str:
    """What is to be written.

    Raises
    ------
    InputError
        If neither the ending nor `to` says it, or nothing would change.
    """
    if to is not None:
        return to
    if output.suffix.lower() != ".json":
        return exchange_format(output)
    if ours:
        raise InputError(
            f"input and {output} are both a {_OURS}", "say --to opencv for OpenCV's JSON"
        )
    return _OURS


def _refuse_choices(
    image_size: tuple[int, int] | None, camera: str | None, pose: Path | None
) -> None:
    if any(choice is not None for choice in (image_size, camera, pose)):
        raise InputError(
            f"a {_OURS} says its image size, camera and light planes itself",
            "leave --image-size, --camera and --pose out",
        )


def _written_as_ours(
    output: Path, source: Calibration | Exchanged, pixel_std: float | None, path: Path
) -> tuple[str, ...]:
    assert isinstance(source, Exchanged)  # a calibration.json is never written from another
    if not source.light_planes:
        raise InputError(
            f"{file_name(path)} holds a camera and no light plane, and a {_OURS} needs both",
            "give a file with light_planes, a HALCON file with --pose, or another --to",
        )
    if pixel_std is None:
        raise InputError(
            f"{file_name(path)} does not state how well image points are found",
            "give --pixel-std in px, 0.1 for well-lit markers",
        )
    calibration = source.as_calibration(pixel_std)
    write_calibration(output, calibration)
    return calibration.warnings


def _convert_corners(path: Path, output: Path, as_json: bool) -> None:
    corners = read_corners(path)
    write_corners(output, corners)
    board, size = corners.board, corners.image_size
    if as_json:
        known = {"kind": board.kind, "columns": board.columns, "rows": board.rows}
        known["pitch_mm"] = list(board.pitch_mm)
        document = {"from": "bouguet", "to": _POINTS, "output": str(output)}
        document |= {"views": list(corners.views.names), "corners": int(corners.views.seen.sum())}
        tell_json(document | {"board": known, "image_size": size, "notes": [_NO_LINE]})
        return
    warn(_NO_LINE)
    tell(
        f"bouguet written to {output} as {_POINTS}: {int(corners.views.seen.sum())} corners in "
        f"{len(corners.views)} views"
    )
    tell(f"beside it, as {_POINTS} of a rig folder, rig.toml needs:\n\n{_rig_lines(corners)}")


_NO_LINE = (
    "corners alone give a camera and no sheet of light – add the points of the line to it, rows "
    "with marker laser, or hold this camera in the calibration of the sheet with --camera"
)


_NO_SIZE = "# image_size = [width, height]: the file does not say it"


def _rig_lines(corners: Corners) -> str:
    """What the file knows of ``rig.toml``."""
    board, size = corners.board, corners.image_size
    said = f"image_size = {list(size)}" if size else _NO_SIZE
    return (
        f'[board]\nkind = "{board.kind}"\ncolumns = {board.columns}\nrows = {board.rows}\n'
        f"pitch_mm = {list(board.pitch_mm)}\n\n[camera]\n{said}"
    )


def _report(
    output: Path, came_from: str, target: str, notes: tuple[str, ...], as_json: bool
) -> None:
    if as_json:
        tell_json({"from": came_from, "to": target, "output": str(output), "notes": list(notes)})
        return
    for note in notes:
        warn(note)
    tell(f"{came_from} written to {output} as {target}")
