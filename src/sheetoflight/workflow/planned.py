"""A rig planned: what uncertainty of lengths to expect before any picture is taken."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sheetoflight.calibration.taken_views import pivot_of
from sheetoflight.errors import InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.quoting import file_name
from sheetoflight.io.reading import naming
from sheetoflight.io.rig_toml import RigFile, read_rig_toml
from sheetoflight.measurement.length_plan import LengthPlan, PlanOptions
from sheetoflight.measurement.planning import plan_lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.nominal import NominalRig, nominal_rig
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.calibrated import load_calibration
from sheetoflight.workflow.spread import ALONE, Execution

_EXAMPLE = "focal_px, sheet_angle_deg and working_distance_mm"


def plan(
    path: str | Path,
    options: PlanOptions | None = None,
    calibration: str | Path | None = None,
    run: Execution = ALONE,
) -> LengthPlan:
    """What uncertainty of lengths to expect of a rig.

    Parameters
    ----------
    path : path
        The ``rig.toml``, or the folder that holds it.
    options : PlanOptions, optional
    calibration : path, optional
        A ``calibration.json`` to take camera, sheets and noise from, in place of ``[plan]``; the
        next position is then the one that its views leave most to tell.
    run : Execution
        Whom to tell of the progress.

    Raises
    ------
    FileError, InputError
        If a file cannot be used, the rig is not described, or the target does not fit.
    UntrustworthyError
        If most sets of so many views do not determine the rig.
    """
    path = Path(path)
    path = path / "rig.toml" if path.is_dir() else path
    described = read_rig_toml(path)
    described.refuse_without_target()
    if calibration is None:
        rig, nominal, taken = described.rig(), _drawn(described), None
    else:
        taken = load_calibration(calibration)
        with naming(calibration):
            rig, nominal = _calibrated(described, taken)
    return plan_lengths(rig, nominal, options, taken, run.progress)


def write_plan_page(path: str | Path, found: LengthPlan) -> None:
    """Write a plan as one self-contained HTML page, whole or not at all.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    from sheetoflight.report.plan_page import build_plan_page

    write_whole(path, build_plan_page(found))


def _drawn(described: RigFile) -> NominalRig:
    """The rig of ``[plan]``."""
    if described.plan is None:
        raise InputError(
            f"{file_name(described.path)} has no table [plan]",
            f"add one with {_EXAMPLE}, or give --calibration",
        )
    return nominal_rig(described.plan, described.rig().image_size, described.lasers)


def _calibrated(described: RigFile, taken: Calibration) -> tuple[Rig, NominalRig]:
    """The rig as a calibration found it, its lasers in the order of ``rig.toml``."""
    size = described.image_size or taken.camera.image_size
    names = [plane.name for plane in taken.light_planes]
    if size != taken.camera.image_size or sorted(names) != sorted(described.lasers):
        raise InputError(
            f"the calibration is of a {taken.camera.image_size[0]} × {taken.camera.image_size[1]} "
            f"px camera with {', '.join(names)}; {file_name(described.path)} says "
            f"{size[0]} × {size[1]} px with {', '.join(described.lasers)}",
            "give the rig.toml that it was made with",
        )
    rig = replace(
        described.rig(picture_size=taken.camera.image_size),
        pixel_std=taken.pixel_std or described.pixel_std,
        placement_std=_placement_std(described, taken),
    )
    noise = f"image points known to {taken.pixel_std:.3g} px, as in the calibration"
    nominal = NominalRig(
        taken.camera,
        tuple(taken.sheet(name) for name in described.lasers),
        _pivot(described, taken),
        _depths(described, taken),
        (noise,) if taken.pixel_std else (),
    )
    return rig, nominal


def _placement_std(described: RigFile, taken: Calibration) -> float | None:
    """As the calibration estimated it, or as the rig file states it."""
    components = taken.covariance.components
    if "placement" in components.names:
        return components.std[components.names.index("placement")]
    return described.placement_std


def _pivot(described: RigFile, taken: Calibration) -> np.ndarray:
    if described.plan and described.plan.pivot_mm:
        return np.array(described.plan.pivot_mm)
    found = pivot_of(taken)
    nearest, farthest = _depths(described, taken)
    return np.array([0.0, 0.0, 0.5 * (nearest + farthest)]) if found is None else found


def _depths(described: RigFile, taken: Calibration) -> tuple[float, float]:
    """As stated, or those at which targets and spots were."""
    if described.plan and described.plan.depth_mm:
        return described.plan.depth_mm
    seen = [v.xyz[:, 2] for v in taken.residuals.views if v.stage in ("plane", "crossing")]
    depths = np.concatenate([np.empty(0), *seen])
    depths = depths[np.isfinite(depths)]
    if depths.size < 2:
        raise InputError(
            "the calibration does not say at which depths targets were",
            "give depth_mm in a table [plan] of rig.toml",
        )
    return float(depths.min()), float(depths.max())
