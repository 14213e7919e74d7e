"""From a nominal rig to what its lengths will be known to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.plan import ViewCounts
from sheetoflight.calibration.planned_rig import planned_rig, with_lens_of
from sheetoflight.calibration.taken_views import taken_views
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.measurement.expected_lengths import LengthGrid, length_grid
from sheetoflight.measurement.length_plan import LengthPlan, PlanOptions
from sheetoflight.measurement.prospects import Progress, budget, prospects_of
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.nominal import NominalRig
from sheetoflight.model.rig import Rig

PIXEL_STD = 0.1
"""Noise of the image points that is assumed where none is stated, px."""

_COARSE, _FINE = (7, 5), (28, 20)
_ENOUGH = 0.5
_PARTS = (0.5, 0.25, 0.125, 0.0625)


def plan_lengths(
    rig: Rig,
    nominal: NominalRig,
    options: PlanOptions | None = None,
    taken: Calibration | None = None,
    progress: Progress | None = None,
) -> LengthPlan:
    """What uncertainty of lengths to expect of a rig.

    Parameters
    ----------
    rig : Rig
        Target, lens model, noise and names of the lasers; observations are not looked at.
    nominal : NominalRig
    options : PlanOptions, optional
    taken : Calibration, optional
        Made with views that are there already: the next position is for them.
    progress : callable, optional
        Called with what is being done, how many parts are done, and how many there are.

    Raises
    ------
    InputError
        If the target or the length does not fit into the picture.
    UntrustworthyError
        If most sets of so many views do not determine the rig.
    """
    options = options or PlanOptions()
    rig, assumed = _with_noise(rig)
    planned = planned_rig(rig, nominal, pivoting=options.counts.camera > 0)
    planned = with_lens_of(planned, taken) if taken else planned
    nominally = _nominal_calibration(rig, nominal)
    length_mm = options.length_mm or _fitting_length(rig, nominally, nominal)
    if length_mm != (options.length_mm or rig.target.length_mm):
        assumed = (*assumed, f"a length of {length_mm:g} mm: the target's own fits too rarely")
    grids = _grids(nominally, nominal, length_mm, _COARSE)
    _refuse_where_nothing_fits(grids, length_mm)
    prospects = prospects_of(planned, grids, options, progress or _silent)
    expected = prospects.expected(options.counts)
    if not np.isfinite(expected.median if expected.best is None else expected.best):
        raise _undetermined(options.counts)
    typical = prospects.typical(options.counts)
    calibration = prospects.calibration(nominally, typical)
    calibrated = None if taken is None else taken_views(planned, taken)
    fine = _grids(nominally, nominal, length_mm, _FINE)
    return LengthPlan(
        options=options,
        rig=rig,
        nominal=nominal,
        assumptions=(*nominal.assumptions, *assumed),
        length_mm=length_mm,
        expected=expected,
        table=prospects.table(options.counts),
        coarse=prospects.fields(grids, options.counts),
        fine=prospects.fields(fine, options.counts),
        calibration=calibration,
        budget=budget(calibration, grids, typical.std),
        wanted=prospects.wanted(options, grids, nominally) if options.wanted_mm else None,
        next_positions=prospects.next_positions(calibrated or typical.told),
        after_taken=calibrated is not None,
    )


def _silent(what: str, done: int, total: int) -> None:
    """Say nothing of the progress."""


def _with_noise(rig: Rig) -> tuple[Rig, tuple[str, ...]]:
    assumed = []
    if rig.pixel_std is None:
        rig = replace(rig, pixel_std=PIXEL_STD)
        assumed.append(f"no pixel_std: image points known to {PIXEL_STD:g} px per coordinate")
    if rig.placement_std is None:
        rig = replace(rig, placement_std=0.0)
        assumed.append("no placement_std_mm: targets lie exactly in the sheet")
    if rig.target.tolerance_mm == 0:
        assumed.append("no tolerance_mm: the target's marker positions are exact")
    return rig, tuple(assumed)


def _nominal_calibration(rig: Rig, nominal: NominalRig) -> Calibration:
    assert rig.pixel_std is not None  # stated or assumed before
    return Calibration(
        method="planned",
        camera=nominal.camera,
        light_planes=nominal.light_planes,
        covariance=Covariance((), np.zeros((0, 0))),
        residuals=Residuals(0.0, 1.0),
        target=rig.target,
        pixel_std=rig.pixel_std,
    )


def _grids(
    nominally: Calibration, nominal: NominalRig, length_mm: float, size: tuple[int, int]
) -> list[LengthGrid]:
    return [
        length_grid(nominally, plane.name, length_mm, nominal.depth_mm, *size)
        for plane in nominal.light_planes
    ]


def _fitting_length(rig: Rig, nominally: Calibration, nominal: NominalRig) -> float:
    """The target's length, or the largest part of it that fits at half of all places."""
    whole = rig.target.length_mm
    for length_mm in (whole, *(float(f"{part * whole:.3g}") for part in _PARTS)):
        grids = _grids(nominally, nominal, length_mm, _COARSE)
        asked = sum(grid.asked for grid in grids)
        if asked and sum(grid.fits.sum() for grid in grids) >= _ENOUGH * asked:
            return length_mm
    return whole


def _refuse_where_nothing_fits(grids: list[LengthGrid], length_mm: float) -> None:
    for grid in grids:
        if not np.isfinite(grid.depth_mm).any():
            raise InputError(
                f"the camera does not see the sheet of {grid.laser} within depth_mm",
                "check sheet_angle_deg, sheet_roll_deg, working_distance_mm and depth_mm",
            )
        if not grid.fits.any():
            raise InputError(
                f"a length of {length_mm:g} mm does not fit into the picture anywhere in the "
                f"sheet of {grid.laser}",
                "plan with a shorter --length-mm",
            )


def _undetermined(counts: ViewCounts) -> UntrustworthyError:
    return UntrustworthyError(
        "plan",
        f"most random sets of {counts.camera} camera views, {counts.plane} positions in the sheet "
        f"and {counts.crossing} crossing views do not determine camera and sheet",
        "plan more views; the table of a plan with 30 and 10 shows what they give",
    )
