"""``sol reconstruct``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.markup import escape

from sheetoflight.cli.looking import (
    BY_DEFAULT,
    Damage,
    LookFor,
    Strict,
    check_output,
    counted,
)
from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    on_all_cores,
    plain_table,
    tell,
    tell_json,
    tell_table,
    warn,
)
from sheetoflight.errors import InputError
from sheetoflight.io.clouds import check_cloud_name, write_cloud
from sheetoflight.io.frames import list_frames
from sheetoflight.io.lines_csv import LINE_COLUMNS, line_row, write_lines
from sheetoflight.io.pictures import in_order_of_names
from sheetoflight.io.quoting import file_name
from sheetoflight.measurement.straightness import SpaceLine
from sheetoflight.measurement.triangulation import is_curved
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.point_cloud import PointCloud, joined_clouds
from sheetoflight.workflow.calibrated import load_any_calibration
from sheetoflight.workflow.reconstructed import Reconstructed, find_points

_MOST_ROWS = 20


def reconstruct(
    calibration: Path,
    inputs: Inputs,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    lines_csv: Path | None = None,
    look: LookFor = BY_DEFAULT,
    laser: str | None = None,
    step_mm: tuple[float, float, float] | None = None,
    strict: Strict = False,
    json: AsJson = False,
) -> None:
    """The laser line in space.

    Parameters
    ----------
    calibration
        The calibration.json.
    inputs
        Pictures of the calibrated camera, pairs NAME_off.* and NAME_on.*, folders, multi-page TIFF
        files, .npy and HDF5 stacks, videos.
    output
        Where to write the points; the ending says how: .ply .las .laz .e57 .csv .xyz .npy. They
        are held in memory until then, 200 bytes each; nothing else grows with the pictures.
    lines_csv
        Where to write the straight line through each piece of the laser line: its length, how far
        its points scatter and how straight it is, beside what noise alone would show. None is
        straight in a curved sheet of light.
    laser
        The laser that is on in the pictures. Needed where the calibration has several.
    step_mm
        X, Y and Z by which the object moves from one picture to the next, in the camera frame (x
        right, y down, z away from the camera). The points of picture k, counted from 0, are moved
        back by k times this, so that all lie where they were when the first picture was taken.
        Pictures that cannot be used count too; of several stacks, one that is cut short has to
        come last.
    strict
        End with status 2 if a picture could not be used, after the others are finished.
    json
        Print a summary and every line as JSON.
    """
    check_cloud_name(output)
    known = load_any_calibration(calibration)
    _refuse_open_choice(known, laser)
    curved = is_curved(known, laser)
    if curved and lines_csv:
        raise InputError(
            "the sheet of light is curved: its lines are straight on nothing",
            "leave --lines-csv out, or calibrate with a flat sheet",
        )
    frames = list_frames(inputs)
    read = [calibration, *frames.files, *look.files]
    check_output(output, read)
    if lines_csv:
        check_output(lines_csv, read)
        _refuse_same(output, lines_csv)
    if step_mm:
        _warn_of_order(inputs)
    damage = Damage()
    with on_all_cores() as run:
        found = find_points(known, frames, look.options, look.background, laser, run, step_mm)
        cloud, lines = _collected(result for _, result in damage.sound(found))
    damage.judge(len(cloud))
    write_cloud(output, cloud)
    if lines_csv:
        write_lines(lines_csv, lines)
    if json:
        tell_json(_document(cloud, lines, damage))
    else:
        if curved:
            tell("the sheet of light is curved: its lines are not judged by their straightness")
        else:
            _tell_lines(lines)
        pictures = f"{counted(damage.used, 'picture')}{damage.ending}"
        tell(f"{counted(len(cloud), 'point')} of {pictures} written to {output}")
    if strict:
        damage.refuse_any()


def _collected(results: Iterable[Reconstructed]) -> tuple[PointCloud, list[SpaceLine]]:
    clouds: list[PointCloud] = []
    lines: list[SpaceLine] = []
    for result in results:
        clouds.append(result.cloud)
        lines.extend(result.lines)
    return joined_clouds(clouds), lines


def _refuse_open_choice(calibration: AnyCalibration, laser: str | None) -> None:
    names = list(calibration.lasers)
    if laser is None and len(names) > 1:
        raise InputError(
            f"the calibration has the lasers {' and '.join(names)}, and which of them is on in "
            "the pictures is not said",
            "name it with --laser, and reconstruct the pictures of each laser by themselves",
        )


def _refuse_same(output: Path, lines_csv: Path) -> None:
    if os.path.realpath(output) == os.path.realpath(lines_csv):
        raise InputError(
            f"points and lines are both to be written to {file_name(output)}", "name two files"
        )


def _warn_of_order(inputs: Sequence[Path]) -> None:
    """A shell lists frame_10 before frame_2; the object did not move so."""
    names = [str(path) for path in inputs]
    for name, sorted_name in zip(names, sorted(names, key=in_order_of_names), strict=True):
        if name != sorted_name:
            warn(
                f"the object is taken to move in the order in which the pictures are named, and "
                f"{file_name(name)} comes where {file_name(sorted_name)} would by the numbers; "
                "name the folder if they lie in one"
            )
            return


def _document(cloud: PointCloud, lines: Sequence[SpaceLine], damage: Damage) -> dict[str, object]:
    return {
        "points": len(cloud),
        "pictures": damage.used,
        "skipped": damage.count,
        "lines": [dict(zip(LINE_COLUMNS, line_row(line), strict=True)) for line in lines],
    }


def _tell_lines(lines: Sequence[SpaceLine]) -> None:
    """Print a table, of the first lines if they are many."""
    table = plain_table(
        "Straight lines through the points, mm",
        ("image",),
        ("line", "points", "length", "standard deviation", "straightness", "expected from noise"),
    )
    for line in lines[:_MOST_ROWS]:
        table.add_row(
            escape(file_name(line.picture)),
            str(line.line),
            str(line.points),
            f"{line.length_mm:.3f}",
            f"{line.rms_mm:.4f}",
            f"{line.straightness_mm:.4f}",
            f"{line.noise_straightness_mm:.4f}",
        )
    tell_table(table)
    if len(lines) > _MOST_ROWS:
        tell(f"and {counted(len(lines) - _MOST_ROWS, 'line')} more; --lines-csv writes all")
