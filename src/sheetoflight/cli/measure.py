"""``sol measure``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sheetoflight.cli.telling import (
    AsJson,
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
from sheetoflight.model.calibration import Calibration
from sheetoflight.workflow.calibrated import load_calibration
from sheetoflight.workflow.measured import (
    MeasuredLength,
    measure_pictures,
    measure_segments,
    pictures_named,
)


def measure(
    calibration: Path,
    inputs: Annotated[list[Path], Parameter(name="INPUTS")],
    /,
    *,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
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
    json
        Print the lengths as JSON.
    """
    if output:
        refuse_to_overwrite(output, [calibration, *inputs])
    known = load_calibration(calibration)
    tables = [path for path in inputs if path.suffix.lower() == ".csv"]
    if tables and len(inputs) > 1:
        raise InputError(
            f"{len(inputs)} inputs with {tables[0].name} among them",
            "give one segments.csv, or pictures, not both",
        )
    found = measure_segments(known, tables[0]) if tables else _in_pictures(known, inputs)
    if output:
        write_lengths(output, [measured.row for measured in found])
    if json:
        tell_json({"lengths": [_document(measured) for measured in found]})
    elif output:
        tell(f"{len(found)} lengths written to {output}")
    else:
        _tell(found)


def _in_pictures(calibration: Calibration, paths: list[Path]) -> list[MeasuredLength]:
    files = pictures_named(paths)
    with on_all_cores() as run:
        pictures = measure_pictures(calibration, files, run)
    found = [measured for picture in pictures for measured in picture.lengths]
    if not found:
        raise UntrustworthyError(
            "measure",
            f"no piece of the laser line with both its ends in {len(files)} pictures",
            "take pictures in which both ends of the lit object are seen, with the laser on",
        )
    for picture in pictures:
        if not picture.lengths:
            seen = f"{len(picture.pieces)} pieces of the line, none with two clear ends"
            warn(
                f"{picture.file.name}: {seen if picture.pieces else 'no laser line'}; "
                "nothing measured"
            )
    return found


def _document(measured: MeasuredLength) -> dict[str, object]:
    low, high = measured.length.interval
    return {
        "segment": measured.segment,
        "length_mm": measured.length.value,
        "std_mm": measured.length.std,
        "low_mm": low,
        "high_mm": high,
        "budget_mm": dict(measured.length.budget),
    }


def _tell(found: list[MeasuredLength]) -> None:
    table = plain_table(
        "Lengths in mm", ("segment",), ("length", "standard uncertainty", "95 % interval")
    )
    for measured in found:
        low, high = measured.length.interval
        table.add_row(
            measured.segment,
            f"{measured.length.value:.3f}",
            f"{measured.length.std:.3f}",
            f"{low:.3f} … {high:.3f}",
        )
    tell_table(table)
