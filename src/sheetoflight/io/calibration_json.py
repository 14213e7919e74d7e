"""``calibration.json``: a calibrated sensor, every number in full precision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.calibration_schema import (
    CalibrationDocument,
    CameraPart,
    LightPlanePart,
    TargetPart,
    ViewPart,
)
from sheetoflight.io.covariance_json import covariance_document, covariance_from
from sheetoflight.io.documents import json_text, read_json
from sheetoflight.io.monte_carlo_json import monte_carlo_document, monte_carlo_from
from sheetoflight.io.quoting import file_name, one_line, shown
from sheetoflight.io.reading import naming
from sheetoflight.io.schema import validated
from sheetoflight.io.second_opinion_json import second_opinion_document, second_opinion_from
from sheetoflight.model.calibration import (
    AnyCalibration,
    Calibration,
    Residuals,
    SheetCalibration,
    ViewResiduals,
)
from sheetoflight.model.camera import Camera
from sheetoflight.model.diagnosis import Finding
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import SheetCurvature
from sheetoflight.model.sheet_map import SheetMap
from sheetoflight.model.target import CollinearTarget

FORMAT = "sheetoflight.calibration"
VERSION = 1

UNIT_TOLERANCE = 1e-6
"""How far a normal's length may lie from 1: more than rounding, less than a typing error."""


def calibration_text(calibration: AnyCalibration) -> str:
    """A calibration as JSON text; the same calibration gives the same text.

    Raises
    ------
    InputError
        If a number is not finite, or the provenance holds what JSON cannot say.
    """
    target, residuals, findings = calibration.target, calibration.residuals, calibration.findings
    with_camera = calibration if isinstance(calibration, Calibration) else None
    monte_carlo = with_camera and with_camera.monte_carlo
    opinion = with_camera and with_camera.second_opinion
    return json_text(
        {
            "format": FORMAT,
            "version": VERSION,
            "method": calibration.method,
            **_geometry_document(calibration),
            **({"target": _target_document(target)} if target else {}),
            "pixel_std": calibration.pixel_std,
            "covariance": covariance_document(calibration.covariance),
            "residuals": {
                "rms_px": residuals.rms_px,
                "chi2_per_dof": residuals.chi2_per_dof,
                "views": [_view_document(view) for view in residuals.views],
            },
            **({"monte_carlo": monte_carlo_document(monte_carlo)} if monte_carlo else {}),
            **({"second_opinion": second_opinion_document(opinion)} if opinion else {}),
            **({"findings": [asdict(one) for one in findings]} if findings else {}),
            "warnings": calibration.warnings,
            "provenance": calibration.provenance,
        }
    )


def _geometry_document(calibration: AnyCalibration) -> dict[str, Any]:
    """Camera and light planes, or the sheet maps of a calibration without a camera."""
    if isinstance(calibration, SheetCalibration):
        return {
            "camera": {"image_size": calibration.image_size},
            "sheet_maps": [
                {"name": sheet.name, "parameters": sheet.parameters}
                for sheet in calibration.sheet_maps
            ],
        }
    camera = calibration.camera
    return {
        "camera": {
            "image_size": camera.image_size,
            "matrix": camera.matrix,
            "distortion": camera.distortion,
        },
        "light_planes": [_plane_document(plane) for plane in calibration.light_planes],
    }


def _plane_document(plane: LightPlane) -> dict[str, Any]:
    curvature = plane.curvature and {
        "centre": plane.curvature.centre,
        "axes": plane.curvature.axes,
        "per_mm": plane.curvature.per_mm,
    }
    return {
        "name": plane.name,
        "normal": plane.normal,
        "distance_mm": plane.distance_mm,
        **({"curvature": curvature} if curvature else {}),
    }


def write_calibration(path: str | Path, calibration: AnyCalibration) -> None:
    """Write ``calibration.json``, whole or not at all.

    Raises
    ------
    InputError
        As `calibration_text`.
    FileError
        If the file cannot be written.
    """
    with naming(path):
        text = calibration_text(calibration)
    write_whole(path, text)


def read_calibration(path: str | Path) -> Calibration:
    """A calibration with its camera, as it was written; keys that are not known are ignored.

    Raises
    ------
    InputError, FileError
        As `read_any_calibration`, and if the file holds no camera.
    """
    found = read_any_calibration(path)
    if isinstance(found, SheetCalibration):
        raise InputError(
            f"{file_name(path)} was calibrated by method {found.method}: it knows the sheet's "
            "picture, but no camera",
            "measure or verify lengths with it; calibrate by method joint for all else",
        )
    return found


def read_any_calibration(path: str | Path) -> AnyCalibration:
    """A calibration as it was written, with or without a camera.

    Raises
    ------
    InputError
        If format or version differ, a key is missing or wrong, a normal is not of length one,
        the covariance is none, or its sources do not add up to it; file and key are named.
    FileError
        If the file cannot be read, or is not JSON.
    """
    document = read_json(path)
    with naming(path):
        _check_format(document)
        content = validated(CalibrationDocument, document)
        return _sheet_calibration(content) if content.sheet_maps else _calibration(content)


def _check_format(document: dict[str, Any]) -> None:
    found, version = document.get("format"), document.get("version")
    if found != FORMAT:
        raise InputError(
            f"format is {'missing' if found is None else shown(found)}, expected '{FORMAT}'",
            "give a calibration.json that this package wrote",
        )
    if version != VERSION or isinstance(version, bool):
        raise InputError(
            f"version is {'missing' if version is None else shown(version)}, expected {VERSION}",
            "calibrate again with this version, or install the one that wrote the file",
        )


def _sheet_calibration(content: CalibrationDocument) -> SheetCalibration:
    width, height = content.camera.image_size
    maps = tuple(
        SheetMap((width, height), *part.parameters, name=part.name) for part in content.sheet_maps
    )
    return SheetCalibration(sheet_maps=maps, **_common(content))


def _calibration(content: CalibrationDocument) -> Calibration:
    if content.light_planes is None:
        raise InputError("'light_planes' is missing", "calibrate again")
    opinion = content.second_opinion
    return Calibration(
        camera=_camera(content.camera),
        light_planes=_light_planes(content.light_planes),
        monte_carlo=monte_carlo_from(content.monte_carlo) if content.monte_carlo else None,
        second_opinion=opinion and second_opinion_from(opinion),
        **_common(content),
    )


def _common(content: CalibrationDocument) -> dict[str, Any]:
    """What every calibration holds beside its sheets."""
    residuals = content.residuals
    views = tuple(_view(view, f"residuals.views[{i}]") for i, view in enumerate(residuals.views))
    return {
        "method": content.method,
        "covariance": covariance_from(content.covariance),
        "residuals": Residuals(residuals.rms_px, residuals.chi2_per_dof, views),
        "target": _target(content.target) if content.target else None,
        "pixel_std": residuals.rms_px if content.pixel_std is None else content.pixel_std,
        "warnings": tuple(content.warnings),
        "findings": tuple(Finding(**part.model_dump()) for part in content.findings),
        "provenance": content.provenance,
    }


def _camera(part: CameraPart) -> Camera:
    width, height = part.image_size
    if part.matrix is None or part.distortion is None:
        raise InputError("camera: 'matrix' or 'distortion' is missing", "calibrate again")
    with naming("camera"):
        return Camera.from_matrix((width, height), np.array(part.matrix), part.distortion)


def _target_document(target: CollinearTarget) -> dict[str, Any]:
    return {"kind": "collinear", **asdict(target)}


def _target(part: TargetPart) -> CollinearTarget:
    with naming("target"):
        return CollinearTarget(**part.model_dump(exclude={"kind"}))


def _light_planes(parts: list[LightPlanePart]) -> tuple[LightPlane, ...]:
    names = [part.name for part in parts]
    if len(set(names)) < len(names):
        raise InputError(
            f"light_planes: two planes share a name: {one_line(', '.join(names))}",
            "give every light plane a name of its own",
        )
    return tuple(_light_plane(part, f"light_planes[{i}]") for i, part in enumerate(parts))


def _light_plane(part: LightPlanePart, key: str) -> LightPlane:
    length = float(np.linalg.norm(part.normal))
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise InputError(
            f"{key}.normal has length {length:.9g}, expected 1",
            "divide the normal by its length; distance_mm is measured along it in mm",
        )
    with naming(key):
        curvature = part.curvature and SheetCurvature(
            np.array(part.curvature.centre),
            np.array(part.curvature.axes),
            np.array(part.curvature.per_mm),
        )
        return LightPlane(np.array(part.normal), part.distance_mm, part.name, curvature)


def _view(part: ViewPart, key: str) -> ViewResiduals:
    count = len(part.uv)
    if len(part.residuals) != count or len(part.xyz) != count:
        raise InputError(
            f"{key} has {count} uv, {len(part.residuals)} residuals and {len(part.xyz)} xyz",
            "give one entry of each for every marker, null where it was not seen",
        )
    return ViewResiduals(
        part.stage, part.view, _rows(part.uv, 2), _rows(part.residuals, 2), _rows(part.xyz, 3)
    )


def _rows(entries: Sequence[list[float] | None], width: int) -> Array:
    """Coordinates ``(M, width)``, NaN for null."""
    rows = [[np.nan] * width if entry is None else entry for entry in entries]
    return np.array(rows, dtype=float).reshape(len(rows), width)


def _view_document(view: ViewResiduals) -> dict[str, Any]:
    return {
        "stage": view.stage,
        "view": view.view,
        "rms_px": view.rms_px,
        "uv": _entries(view.uv),
        "residuals": _entries(view.residuals),
        "xyz": _entries(view.xyz),
    }


def _entries(coordinates: Array) -> list[list[float] | None]:
    """A list for each marker, null where a coordinate is NaN."""
    rows = np.asarray(coordinates, dtype=float)
    return [None if np.isnan(row).any() else row.tolist() for row in rows]
