"""``sol report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sheetoflight.cli.telling import on_all_cores, refuse_to_overwrite, tell
from sheetoflight.errors import InputError
from sheetoflight.workflow.calibrated import load_calibration
from sheetoflight.workflow.measured import measure_pictures, pictures_named
from sheetoflight.workflow.reported import write_report


def report(
    calibration: Path,
    pictures: Annotated[list[Path] | None, Parameter(name="PICTURES")] = None,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("report.html"),
    laser: str | None = None,
) -> None:
    """One self-contained page: the numbers, figures to turn with the mouse, what was used.

    Parameters
    ----------
    calibration
        The calibration.json.
    pictures
        Pictures with the laser line, or a folder of these, to be measured and shown.
    output
        Where to write the page.
    laser
        The laser that is on in the pictures; needed where the calibration has several.
    """
    refuse_to_overwrite(output, [calibration, *(pictures or [])])
    for path in pictures or []:
        if path.suffix.lower() == ".csv":
            raise InputError(
                f"{path} is a table", "give pictures; lengths of a segments.csv: sol measure"
            )
    known = load_calibration(calibration)
    with on_all_cores() as run:
        measured = measure_pictures(known, pictures_named(pictures or []), run, laser)
    write_report(output, known, measured)
    tell(f"written to {output}")
