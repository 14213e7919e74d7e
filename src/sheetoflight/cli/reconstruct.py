"""``sol reconstruct``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sheetoflight.cli.looking import BY_DEFAULT, Damage, LookFor
from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    on_all_cores,
    refuse_to_overwrite,
    tell,
    tell_json,
)
from sheetoflight.io.clouds import check_cloud_name, write_cloud
from sheetoflight.io.frames import list_frames
from sheetoflight.model.point_cloud import joined_clouds
from sheetoflight.workflow.calibrated import load_any_calibration
from sheetoflight.workflow.reconstructed import find_points


def reconstruct(
    calibration: Path,
    inputs: Inputs,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    look: LookFor = BY_DEFAULT,
    laser: str | None = None,
    strict: bool = False,
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
        Where to write the points; the ending says how: .ply .las .laz .e57 .csv .xyz .npy
    look
        How the line is looked for.
    laser
        The laser that is on in the pictures. Needed where the calibration has several.
    strict
        End with status 2 if a picture could not be used, after the others are finished.
    json
        Print a summary as JSON.
    """
    refuse_to_overwrite(output, [calibration, *inputs])
    check_cloud_name(output)
    known = load_any_calibration(calibration)
    frames = list_frames(inputs)
    damage = Damage()
    with on_all_cores() as run:
        found = find_points(known, frames, look.options, look.background, laser, run)
        cloud = joined_clouds([result.cloud for _, result in damage.sound(found)])
    damage.judge(len(cloud))
    write_cloud(output, cloud)
    if json:
        tell_json({"points": len(cloud), "pictures": damage.used, "skipped": len(damage.frames)})
    else:
        tell(f"{len(cloud)} points of {damage.used} pictures written to {output}")
    if strict:
        damage.refuse_any()
