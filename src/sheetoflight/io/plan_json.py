"""A plan as a JSON document."""

from __future__ import annotations

import math
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.io.documents import write_json
from sheetoflight.measurement.length_plan import (
    Expected,
    ExpectedField,
    LengthPlan,
    NextPosition,
    Wanted,
)

FORMAT = "sheetoflight.plan"
VERSION = 1


def plan_document(plan: LengthPlan) -> dict[str, Any]:
    """The plan in JSON's own types; what cannot be had is None."""
    counts = plan.options.counts
    return {
        "format": FORMAT,
        "version": VERSION,
        "views": {"camera": counts.camera, "plane": counts.plane, "crossing": counts.crossing},
        "chosen": plan.options.best,
        "length_mm": plan.length_mm,
        "std_mm": plan.headline_mm,
        "expected": _expected(plan.expected),
        "budget_mm": dict(plan.budget),
        "positions": [{"plane": n, **_expected(row)} for n, row in plan.table],
        "field": [_field(field) for field in plan.coarse],
        "wanted": None if plan.wanted is None else _wanted(plan.wanted),
        "next": [_next(position) for position in plan.next_positions],
        "next_after": "views of the calibration" if plan.after_taken else "planned views",
        "planned_views": [
            {"stage": view.stage, "view": view.view, "uv": _rows(view.uv), "xyz": _rows(view.xyz)}
            for view in plan.calibration.residuals.views
        ],
        "assumptions": list(plan.assumptions),
        "rig": _rig(plan),
        "provenance": {
            "software": f"sheetoflight {version('sheetoflight')}",
            "rig": Path(plan.rig.source).name,
            "seed": plan.options.seed,
        },
    }


def write_plan(path: str | Path, plan: LengthPlan) -> None:
    """Write a plan as JSON, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_json(path, plan_document(plan))


def _expected(expected: Expected) -> dict[str, float | None]:
    return {
        "median_mm": _number(expected.median),
        "low_mm": _number(expected.low),
        "high_mm": _number(expected.high),
        "chosen_mm": None if expected.best is None else _number(expected.best),
    }


def _field(field: ExpectedField) -> dict[str, Any]:
    along = ("rows", "columns")
    return {
        "laser": field.laser,
        "u": field.u.tolist(),
        "v": field.v.tolist(),
        "depth_mm": _rows(field.depth_mm),
        "std_mm": dict(zip(along, map(_rows, field.std_mm), strict=True)),
        "calibration_mm": dict(zip(along, map(_rows, field.calibration_mm), strict=True)),
        "image_points_mm": dict(zip(along, map(_rows, field.image_mm), strict=True)),
    }


def _wanted(wanted: Wanted) -> dict[str, Any]:
    return {
        "std_mm": wanted.std_mm,
        "possible": wanted.possible,
        "positions": wanted.positions,
        "chosen_positions": wanted.chosen_positions,
        "choices": [{"camera": camera, "plane": plane} for camera, plane in wanted.choices],
        "bound_mm": wanted.bound_mm,
        "bound_by_source_mm": dict(wanted.bound),
    }


def _next(position: NextPosition) -> dict[str, Any]:
    view = position.view
    return {
        "stage": view.stage,
        "laser": view.laser if view.stage != "camera" else None,
        "in_words": view.in_words,
        "uv": _rows(view.uv),
        "xyz": _rows(view.points),
        "before_mm": _number(position.before_mm),
        "after_mm": _number(position.after_mm),
        "variance_gain": view.gain,
        "typical_variance_gain": view.typical_gain,
    }


def _rig(plan: LengthPlan) -> dict[str, Any]:
    nominal = plan.nominal
    return {
        "camera": {
            "image_size": list(nominal.camera.image_size),
            "matrix": nominal.camera.matrix.tolist(),
            "distortion": list(nominal.camera.distortion),
        },
        "light_planes": [
            {"name": p.name, "normal": p.normal.tolist(), "distance_mm": p.distance_mm}
            for p in nominal.light_planes
        ],
        "markers_mm": list(plan.rig.target.markers_mm),
        "tolerance_mm": plan.rig.target.tolerance_mm,
        "pixel_std": plan.rig.pixel_std,
        "placement_std_mm": plan.rig.placement_std,
        "pivot_mm": nominal.pivot_mm.tolist(),
        "depth_mm": list(nominal.depth_mm),
    }


def _rows(values: Array) -> list[list[float | None]]:
    return [[_number(x) for x in row] for row in np.asarray(values).tolist()]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
