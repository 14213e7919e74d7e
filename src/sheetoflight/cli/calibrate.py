"""``sol calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from sheetoflight.calibration.methods import CalibrationOptions
from sheetoflight.calibration.paper_plane import PaperOptions
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
from sheetoflight.estimation.genetic import GeneticOptions
from sheetoflight.model.calibration import Calibration
from sheetoflight.workflow.calibrated import calibrate_folder

_UNITS = {**dict.fromkeys(("alpha", "beta", "gamma", "u0", "v0"), "px"), "d": "mm"}
_GENETIC = GeneticOptions()
_PAPER = PaperOptions()


def calibrate(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("calibration.json"),
    method: Literal["joint", "two-step", "paper"] = "joint",
    json: AsJson = False,
    seed: int = _GENETIC.seed,
    population: int = _GENETIC.population,
    generations: int = _GENETIC.generations,
    threshold: float = _PAPER.threshold_mm,
) -> None:
    """Calibrate camera and sheet of light from a rig folder.

    Parameters
    ----------
    folder
        The rig folder.
    output
        Where to write the calibration.
    method
        joint: everything in one adjustment. two-step: the camera first, then the sheet.
        paper: triangulation, RANSAC and a genetic search, as in the paper.
    json
        Print the result as JSON.
    seed
        Seed of the genetic search (method paper).
    population
        Individuals of the genetic search; the paper takes 3000 (method paper).
    generations
        Generations of the genetic search; the paper takes 300 (method paper).
    threshold
        Greatest distance of an inlier from the plane in mm (method paper).
    """
    options = CalibrationOptions(
        PaperOptions(threshold_mm=threshold, genetic=GeneticOptions(population, generations, seed))
    )
    refuse_to_overwrite(output, ())
    with on_all_cores() as run:
        calibration = calibrate_folder(folder, method, options, run)
    calibration.save(output)
    for warning in calibration.warnings:
        warn(warning)
    if json:
        tell_json(calibration_summary(calibration) | {"file": str(output)})
    else:
        tell_calibration(calibration)
        tell(f"written to {output}")


def calibration_summary(calibration: Calibration) -> dict[str, Any]:
    """The numbers that a program asks for first; all else stands in the file."""
    plane = calibration.light_plane
    return {
        "method": calibration.method,
        "camera": dict(
            zip(calibration.camera.PARAMETERS, calibration.camera.parameters.tolist(), strict=True)
        ),
        "light_plane": {"normal": plane.normal.tolist(), "distance_mm": plane.distance_mm},
        "std": {
            name: calibration.covariance.std(name) for name in calibration.covariance.parameters
        },
        "pixel_std": calibration.pixel_std,
        "rms_px": calibration.residuals.rms_px,
        "chi2_per_dof": calibration.residuals.chi2_per_dof,
        "warnings": list(calibration.warnings),
    }


def tell_calibration(calibration: Calibration) -> None:
    """Print estimates with their standard uncertainties."""
    table = plain_table(
        f"Calibration by method {calibration.method}",
        ("parameter",),
        ("value", "standard uncertainty", "unit"),
    )
    plane = calibration.light_plane
    values = dict(
        zip(
            (f"camera.{name}" for name in calibration.camera.PARAMETERS),
            calibration.camera.parameters,
            strict=True,
        )
    )
    values |= {
        f"{plane.name}.{part}": value
        for part, value in zip(
            ("nx", "ny", "nz", "d"), (*plane.normal, plane.distance_mm), strict=True
        )
    }
    for name, value in values.items():
        if name in calibration.covariance.parameters:
            std = calibration.covariance.std(name)
            table.add_row(name, f"{value:.6g}", f"{std:.2g}", _UNITS.get(name.split(".")[1], ""))
    tell_table(table)
    views = {}
    for view in calibration.residuals.views:
        views[view.stage] = views.get(view.stage, 0) + 1
    seen = ", ".join(f"{count} in stage {stage}" for stage, count in views.items())
    tell(
        f"views: {seen}; residuals {calibration.residuals.rms_px:.3f} px rms, "
        f"image points known to {calibration.pixel_std:.3f} px"
    )
