"""The camera first, then maximum likelihood on the sheets with the camera held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.camera_alone import camera_alone, with_known_pixel_noise
from sheetoflight.calibration.fitting import Fit, fitted
from sheetoflight.calibration.identifiability import require_determined, require_open_sheets
from sheetoflight.calibration.noise import PIXEL, NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import intrinsic_names, sheet_names
from sheetoflight.calibration.starts import evidence, with_sheets
from sheetoflight.calibration.uncertainty import chained, influence
from sheetoflight.geometry.directions import Array
from sheetoflight.model.rig import Rig


def two_step(rig: Rig, noise: NoiseModel) -> Outcome:
    """Camera from the pivoting target alone; sheets from all other views, the camera held.

    Raises
    ------
    UntrustworthyError
        If the views of a step do not determine what it is to estimate.
    """
    camera, weak = camera_alone(rig, noise)
    stages = {s: v for s, v in rig.observations.stages().items() if s != "camera"}
    sheets = sheet_names(len(rig.lasers))
    start = with_sheets(rig, evidence(rig), camera.state)
    fit = fitted(rig, stages, sheets, start, with_known_pixel_noise(camera), "plane")
    weak = (*weak, *require_determined(fit, "plane"))
    require_open_sheets(fit)
    names = intrinsic_names(rig.free_intrinsics)
    joined = _joined(camera, fit)
    told = replace(fit, size_covariance=joined.size_covariance)
    first, second = influence(camera, names, "camera"), influence(told, sheets, "plane")
    both = chained(first, second, _slope_by_camera(rig, fit, names, sheets))
    return Outcome(fit.state, both, (camera, fit), joined, weak)


def _joined(camera: Fit, sheet: Fit) -> Fit:
    """The camera's fit with what the in-plane views told of the placement noise."""
    spread = sheet.size_covariance.copy()
    spread[PIXEL, PIXEL] = camera.size_covariance[PIXEL, PIXEL]
    return replace(camera, noise=sheet.noise, size_covariance=spread)


def _slope_by_camera(rig: Rig, fit: Fit, names: tuple[str, ...], sheets: tuple[str, ...]) -> Array:
    """How the sheets move with the camera that they were computed with."""
    wider = fit.noise.adjustment(rig, fit.adjustment.stages, (*names, *sheets), fit.state)
    information = replace(fit, adjustment=wider).model().information
    own, mixed = information[len(names) :, len(names) :], information[len(names) :, : len(names)]
    return -np.linalg.solve(own, mixed)
