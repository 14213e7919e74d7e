"""``sol calibrate``."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.markup import escape
from rich.table import Table

from sheetoflight.calibration.match_methods import MATCH_METHODS
from sheetoflight.calibration.methods import CAMERA_FREE, CalibrationOptions
from sheetoflight.calibration.paper_plane import PaperOptions
from sheetoflight.calibration.self_generated_method import SELF_GENERATED
from sheetoflight.cli.monte_carlo import (
    calibrate_and_check,
    monte_carlo_summary,
    tell_monte_carlo,
)
from sheetoflight.cli.second_opinion import second_opinion_summary, tell_second_opinion
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
from sheetoflight.errors import InputError
from sheetoflight.estimation.genetic import GeneticOptions
from sheetoflight.measurement.monte_carlo import MonteCarloOptions
from sheetoflight.model.calibration import Calibration, SheetCalibration
from sheetoflight.model.covariance import SHEET_MAP_PARTS
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.report.budget import budget_table, parameter_budgets
from sheetoflight.report.noise import noise_rows
from sheetoflight.report.numbers import parameter_unit, rounded
from sheetoflight.workflow.calibrated import calibrate as calibrate_rig
from sheetoflight.workflow.calibrated import with_camera
from sheetoflight.workflow.rig_folder import read_rig_folder

_GENETIC = GeneticOptions()
_PAPER = PaperOptions()


def calibrate(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("calibration.json"),
    method: Literal[
        "joint",
        "two-step",
        "paper",
        "planar-lines",
        "cross-ratio",
        "zigzag",
        "self-generated",
        "camera-free",
        "rotating-camera",
        "moving-camera",
    ] = "joint",
    camera: Path | None = None,
    json: AsJson = False,
    seed: int = _GENETIC.seed,
    population: int = _GENETIC.population,
    generations: int = _GENETIC.generations,
    threshold: float = _PAPER.threshold_mm,
    monte_carlo: int | None = None,
    flat: bool = False,
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
        paper: triangulation, RANSAC and a genetic search, as in the paper. planar-lines,
        cross-ratio, zigzag: the camera from the boards first, then a plane through the line's
        points on them, through its crossings with rows of known points, or through its spots on
        the ridges of a solid body. self-generated: with --camera, from points of the line on a
        bare plate whose places in the sheet a stage tells (columns x, y of points.csv).
        camera-free: from in-plane views alone, for lengths on the sheet. rotating-camera,
        moving-camera: the camera alone, without any target, from points matched between pictures
        of a camera that only turned, or was carried about (stage match of points.csv).
    camera
        The camera, where it is known already: a calibration.json, or a file of OpenCV, ROS,
        Kalibr, HALCON or Bouguet's toolbox. It is held, and its uncertainty carried on.
    json
        Print the result as JSON.
    seed
        Seed of the genetic search (method paper) and of the Monte Carlo: one for both.
    population
        Individuals of the genetic search; the paper takes 3000 (method paper).
    generations
        Generations of the genetic search; the paper takes 300 (method paper).
    threshold
        Greatest distance of an inlier from the plane in mm (method paper).
    monte_carlo
        Re-simulate the rig from the result and calibrate it again so many times, 100 or more, and
        compare the spread of parameters and lengths with the stated uncertainties. 1000 take
        about a quarter of a minute on two cores (method paper: far longer).
    flat
        Fit planes even where the lines on boards show that a sheet is curved (method joint; the
        others know planes only).
    """
    genetic = GeneticOptions(population, generations, seed)
    options = CalibrationOptions(PaperOptions(threshold_mm=threshold, genetic=genetic), flat)
    check = None if monte_carlo is None else MonteCarloOptions(monte_carlo, seed)
    refuse_to_overwrite(output, ())
    with on_all_cores() as run:
        seen = read_rig_folder(folder, run)
        rig = seen.rig
        if camera is not None:
            rig = with_camera(rig, camera)
        if check is None:
            calibration = calibrate_rig(rig, method, options)
        elif method == CAMERA_FREE:
            raise InputError(
                "--monte-carlo re-simulates a camera, which method camera-free does not know",
                "use --method joint with it",
            )
        elif method in MATCH_METHODS or method == SELF_GENERATED:
            raise InputError(
                f"--monte-carlo re-simulates targets, and method {method} has none",
                "leave it out",
            )
        else:
            calibration = calibrate_and_check(rig, method, options, check, run)
    missed = tuple(one.in_words for one in seen.missed)
    calibration = replace(calibration, warnings=(*missed, *calibration.warnings))
    calibration.save(output)
    for warning in calibration.warnings:
        warn(warning)
    if isinstance(calibration, SheetCalibration):
        _tell_sheets(calibration, output, json)
    elif json:
        summary = calibration_summary(calibration)
        if calibration.monte_carlo:
            summary["monte_carlo"] = monte_carlo_summary(calibration.monte_carlo)
        tell_json(summary | {"file": str(output)})
    else:
        tell_calibration(calibration)
        if calibration.monte_carlo:
            tell_monte_carlo(calibration.monte_carlo)
        tell(f"written to {output}")


def _tell_sheets(calibration: SheetCalibration, output: Path, json: bool) -> None:
    """The sheet maps with their standard uncertainties."""
    covariance = calibration.covariance
    values = {
        f"{sheet.name}.{part}": float(value)
        for sheet in calibration.sheet_maps
        for part, value in zip(SHEET_MAP_PARTS, sheet.parameters, strict=True)
    }
    if json:
        tell_json(
            {
                "method": calibration.method,
                "sheet_maps": values,
                "std": {name: covariance.std(name) for name in values},
                "pixel_std": calibration.pixel_std,
                "rms_px": calibration.residuals.rms_px,
                "chi2_per_dof": calibration.residuals.chi2_per_dof,
                "warnings": list(calibration.warnings),
                "file": str(output),
            }
        )
        return
    table = plain_table(
        f"Calibration by method {calibration.method}",
        ("parameter",),
        ("value", "standard uncertainty"),
    )
    for name, value in values.items():
        table.add_row(escape(name), *rounded(value, covariance.std(name)))
    tell_table(table)
    tell(
        f"views: {len(calibration.residuals.views)} in stage plane; residuals "
        f"{calibration.residuals.rms_px:.3f} px rms, image points known to "
        f"{calibration.pixel_std:.3f} px"
    )
    tell(f"written to {output}")


def calibration_summary(calibration: Calibration) -> dict[str, Any]:
    """The numbers that a program asks for first; all else stands in the file."""
    covariance = calibration.covariance
    planes = [_plane_summary(plane) for plane in calibration.light_planes]
    opinion = calibration.second_opinion
    return {
        "method": calibration.method,
        "camera": dict(
            zip(calibration.camera.PARAMETERS, calibration.camera.parameters.tolist(), strict=True)
        ),
        "light_plane": planes[0] if planes else None,
        "light_planes": planes,
        "std": {name: covariance.std(name) for name in covariance.parameters},
        "std_by_source": {
            budget.name: dict(budget.shares) for budget in parameter_budgets(covariance)
        },
        "noise_std": dict(zip(covariance.components.names, covariance.components.std, strict=True)),
        "pixel_std": calibration.pixel_std,
        "rms_px": calibration.residuals.rms_px,
        "chi2_per_dof": calibration.residuals.chi2_per_dof,
        "findings": [asdict(finding) for finding in calibration.findings],
        **({"second_opinion": second_opinion_summary(opinion)} if opinion else {}),
        "warnings": list(calibration.warnings),
    }


def _plane_summary(plane: LightPlane) -> dict[str, Any]:
    told = {"name": plane.name, "normal": plane.normal.tolist(), "distance_mm": plane.distance_mm}
    if plane.curvature is None:
        return told
    bend = plane.curvature
    parts = {"centre": bend.centre, "axes": bend.axes, "per_mm": bend.per_mm}
    return told | {"curvature": {name: values.tolist() for name, values in parts.items()}}


def tell_calibration(calibration: Calibration) -> None:
    """Print estimates with their standard uncertainties, what these come from, and the noise."""
    tell_table(_estimates(calibration))
    if calibration.covariance.parameters:
        tell_table(_sources(calibration))
    tell_table(_noise(calibration))
    if calibration.second_opinion:
        tell_second_opinion(calibration.second_opinion)
    views: dict[str, int] = {}
    for view in calibration.residuals.views:
        views[view.stage] = views.get(view.stage, 0) + 1
    seen = ", ".join(f"{count} in stage {stage}" for stage, count in views.items())
    tell(
        f"views: {seen}; residuals {calibration.residuals.rms_px:.3f} px rms, "
        f"image points known to {calibration.pixel_std:.3f} px"
    )


def _estimates(calibration: Calibration) -> Table:
    table = plain_table(
        f"Calibration by method {calibration.method}",
        ("parameter",),
        ("value", "standard uncertainty", "unit"),
    )
    camera = calibration.camera
    values = {f"camera.{p}": v for p, v in zip(camera.PARAMETERS, camera.parameters, strict=True)}
    for plane in calibration.light_planes:
        values |= plane.parameters
    for name, value in values.items():
        if name in calibration.covariance.parameters:
            std = calibration.covariance.std(name)
            table.add_row(escape(name), *rounded(float(value), std), parameter_unit(name))
    return table


def _sources(calibration: Calibration) -> Table:
    budgets = budget_table(parameter_budgets(calibration.covariance))
    table = plain_table(
        "Standard uncertainty by source", ("parameter",), tuple(map(escape, budgets.sources))
    )
    for row in budgets.rows:
        table.add_row(escape(row.name), *(share.std for share in row.shares))
    return table


def _noise(calibration: Calibration) -> Table:
    table = plain_table("Noise", ("noise",), ("size", "standard uncertainty", "unit"))
    table.add_column("where it comes from")
    for row in noise_rows(calibration):
        table.add_row(escape(row.name), row.size, row.std, row.unit, row.origin)
    return table
