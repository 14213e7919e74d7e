"""``sol measure``."""

from __future__ import annotations

import math
from pathlib import Path

from rich.markup import escape

from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    Output,
    on_all_cores,
    plain_table,
    refuse_to_overwrite,
    tell,
    tell_json,
    tell_table,
    warn,
)
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.io.segments_csv import write_lengths
from sheetoflight.measurement.comparison import MeasuredSegment
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.workflow.calibrated import load_any_calibration
from sheetoflight.workflow.measured import (
    length_row,
    measure_pictures,
    measure_segments,
    pictures_named,
)


def measure(
    calibration: Path,
    inputs: Inputs,
    /,
    *,
    output: Output = None,
    laser: str | None = None,
    json: AsJson = False,
) -> None:
    """Lengths with their 95 % intervals.

    Parameters
    ----------
    calibration
        The calibration.json.
    inputs
        One segments.csv; or pictures, pairs NAME_off.* and NAME_on.*, or a folder of these.
    output
        Where to write lengths.csv; the lengths are printed where absent.
    laser
        The laser that is on in the pictures, or whose sheet those segments lie on that name
        none. Needed where the calibration has several.
    json
        Print the lengths as JSON.
    """
    if output:
        refuse_to_overwrite(output, [calibration, *inputs])
    known = load_any_calibration(calibration)
    tables = [path for path in inputs if path.suffix.lower() == ".csv"]
    if tables and len(inputs) > 1:
        raise InputError(
            f"{len(inputs)} inputs with {tables[0].name} among them",
            "give one segments.csv, or pictures, not both",
        )
    if tables:
        found = measure_segments(known, tables[0], laser)
    else:
        found = _in_pictures(known, inputs, laser)
    if output:
        write_lengths(output, map(length_row, found))
    if json:
        tell_json({"lengths": [_document(measured) for measured in found]})
    elif output:
        tell(f"{len(found)} lengths written to {output}")
    else:
        _tell(found)


def _in_pictures(
    calibration: AnyCalibration, paths: list[Path], laser: str | None
) -> list[MeasuredSegment]:
    files = pictures_named(paths)
    with on_all_cores() as run:
        pictures = measure_pictures(calibration, files, run, laser)
    found = [measured for picture in pictures for measured in picture.segments]
    if not found:
        raise UntrustworthyError(
            "measure",
            f"no piece of the laser line with both its ends in {len(files)} pictures",
            "take pictures in which both ends of the lit object are seen, with the laser on",
        )
    for picture in pictures:
        if not picture.segments:
            seen = f"{len(picture.pieces)} pieces of the line, none with two clear ends"
            warn(
                f"{picture.file.name}: {seen if picture.pieces else 'no laser line'}; "
                "nothing measured"
            )
    return found


def _document(measured: MeasuredSegment) -> dict[str, object]:
    length, (low, high) = measured.length, measured.length.interval
    freedom = length.degrees_of_freedom
    return {
        "segment": measured.name,
        "laser": measured.laser,
        "length_mm": length.value,
        "std_mm": length.std,
        "low_mm": low,
        "high_mm": high,
        "degrees_of_freedom": freedom if math.isfinite(freedom) else None,
        "budget_mm": dict(length.budget),
    }


def _tell(found: list[MeasuredSegment]) -> None:
    table = plain_table(
        "Lengths in mm", ("segment",), ("length", "standard uncertainty", "95 % interval")
    )
    for measured in found:
        low, high = measured.length.interval
        table.add_row(
            escape(measured.name),
            f"{measured.length.value:.3f}",
            f"{measured.length.std:.3f}",
            f"{low:.3f} … {high:.3f}",
        )
    tell_table(table)
