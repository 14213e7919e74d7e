"""The camera first, then maximum likelihood on the sheets with the camera held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.camera_alone import camera_alone, with_known_pixel_noise
from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.fitting import Fit, fitted
from sheetoflight.calibration.identifiability import (
    determined,
    require_open_sheets,
    roughly_determined,
)
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import RigState, intrinsic_names, sheet_names
from sheetoflight.calibration.starts import evidence, with_sheets
from sheetoflight.calibration.uncertainty import chained, influence
from sheetoflight.geometry.directions import Array
from sheetoflight.model.rig import Rig


def two_step(
    rig: Rig, noise: NoiseModel, fit: Fit | None = None, start: RigState | None = None
) -> Outcome:
    """Camera from the pivoting target alone; sheets from all other views, the camera held.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    fit : Fit, optional
        The joint fit, where there is one: it tells how large the noise is. In the second step's
        own residuals the camera's error would pass for noise.

    Raises
    ------
    UntrustworthyError
        If the views of a step do not determine what it is to estimate.
    """
    if fit is not None and not (fit.solution.converged and roughly_determined(fit)):
        fit = None  # what does not fit together tells no noise
    told = None if fit is None else fit.noise
    camera, weak = camera_alone(rig, noise if told is None else _known(told))
    stages = {s: v for s, v in rig.observations.stages().items() if s != "camera"}
    sheets = sheet_names(len(rig.lasers))
    start = with_sheets(rig, evidence(rig), camera.state)
    noise_now = with_known_pixel_noise(camera) if told is None else _known(told)
    sheet = fitted(rig, stages, sheets, start, noise_now, "plane")
    sheet, weak_sheet = determined(sheet, "plane")
    require_open_sheets(sheet)
    weak = (*weak, *weak_sheet)
    names = intrinsic_names(rig.free_intrinsics)
    spread = _size_covariance(camera, sheet) if fit is None else fit.size_covariance
    camera, sheet = (replace(step, size_covariance=spread) for step in (camera, sheet))
    first, second = influence(camera, names, "camera"), influence(sheet, sheets, "plane")
    both = chained(first, second, _slope_by_camera(rig, sheet, names, sheets))
    joined = replace(camera, noise=sheet.noise)
    return Outcome(sheet.state, both, (camera, sheet), joined, weak)


def _known(noise: NoiseModel) -> NoiseModel:
    return replace(noise, free=np.zeros_like(noise.free))


def _size_covariance(camera: Fit, sheet: Fit) -> Array:
    """The camera stage told the pixel noise, the in-plane views the placement noise."""
    spread = sheet.size_covariance.copy()
    spread[PIXEL, PIXEL] = camera.size_covariance[PIXEL, PIXEL]
    return spread


def _slope_by_camera(rig: Rig, fit: Fit, names: tuple[str, ...], sheets: tuple[str, ...]) -> Array:
    """How the sheets move with the camera that they were computed with."""
    wider = fit.noise.adjustment(rig, fit.adjustment.stages, (*names, *sheets), fit.state)
    information = replace(fit, adjustment=wider).model().information
    own, mixed = information[len(names) :, len(names) :], information[len(names) :, : len(names)]
    return -np.linalg.solve(own, mixed)
