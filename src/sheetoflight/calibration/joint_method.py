"""All evidence in one maximum-likelihood adjustment."""

from __future__ import annotations

from sheetoflight.calibration.curved_sheets import curved
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.held_camera import refuse_nothing_left, with_known_camera
from sheetoflight.calibration.identifiability import determined, require_open_sheets
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import (
    RigState,
    bend_names,
    intrinsic_names,
    sheet_names,
)
from sheetoflight.calibration.search import best_fit
from sheetoflight.calibration.starts import with_sheets
from sheetoflight.calibration.uncertainty import influence
from sheetoflight.model.rig import Rig


def joint(
    rig: Rig,
    noise: NoiseModel,
    fit: Fit | None = None,
    start: RigState | None = None,
    flat: bool = False,
) -> Outcome:
    """Camera, sheets and poses from any stages that suffice together.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    fit : Fit, optional
        The fit of everything, where it is there already.
    start : RigState, optional
        Camera and poses of the boards, where there are boards.
    flat : bool
        Sheets are planes, whatever the lines on boards say.

    Raises
    ------
    UntrustworthyError
        If they do not determine what is to be estimated.
    """
    refuse_nothing_left(rig)
    fit = fit or best_fit(EstimationTask.of_everything(rig, noise, start), with_sheets)
    fit, weak = determined(fit, "joint" if rig.observations.stages() else "board")
    require_open_sheets(fit)
    fit, told = (fit, ()) if flat else curved(fit, noise)
    names = (*intrinsic_names(rig.free_intrinsics), *sheet_names(len(rig.lasers)))
    names += tuple(
        name for name in bend_names(len(rig.lasers)) if name in fit.adjustment.parameters
    )
    found = influence(fit, names, "joint")
    if rig.camera_covariance is not None:
        found = with_known_camera(fit, found, rig.camera_covariance)
    return Outcome(fit.state, found, (fit,), fit, (*weak, *told))
