"""The camera first, then maximum likelihood on the sheets with the camera held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.camera_alone import camera_alone, with_known_pixel_noise
from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.held_camera import by_camera
from sheetoflight.calibration.identifiability import (
    determined,
    require_open_sheets,
    roughly_determined,
)
from sheetoflight.calibration.joint_method import joint
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import RigState, intrinsic_names, sheet_names
from sheetoflight.calibration.starts import evidence, with_sheets
from sheetoflight.calibration.uncertainty import chained, influence
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import no_views
from sheetoflight.model.rig import Rig


def two_step(
    rig: Rig, noise: NoiseModel, fit: Fit | None = None, start: RigState | None = None
) -> Outcome:
    """Camera from the pivoting target and the boards' points; sheets from all other views, the
    camera held.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    fit : Fit, optional
        The joint fit, where there is one: it tells how large the noise is. In the second step's
        own residuals the camera's error would pass for noise.
    start : RigState, optional
        Camera and poses of the boards, where there are boards.

    Raises
    ------
    UntrustworthyError
        If the views of a step do not determine what it is to estimate.
    """
    if rig.camera is not None:
        return joint(rig, noise, fit, start)  # the first step is done
    if fit is not None and not (fit.solution.converged and roughly_determined(fit)):
        fit = None  # what does not fit together tells no noise
    told = None if fit is None else fit.noise
    camera, weak = camera_alone(rig, noise if told is None else _known(told), start)
    if not rig.lasers:
        names = intrinsic_names(rig.free_intrinsics)
        return Outcome(camera.state, influence(camera, names, "camera"), (camera,), camera, weak)
    seen = replace(rig, observations=replace(rig.observations, camera=no_views()))
    stages = seen.observations.stages()
    sheets = sheet_names(len(rig.lasers))
    found = evidence(seen) if stages else None
    held = with_sheets(seen, found, camera.state)
    noise_now = with_known_pixel_noise(camera) if told is None else _known(told)
    blamed = "plane" if stages else "board"
    sheet = fitted(seen, stages, sheets, held, noise_now, blamed)
    sheet, weak_sheet = determined(sheet, blamed)
    require_open_sheets(sheet)
    weak = (*weak, *weak_sheet)
    names = intrinsic_names(rig.free_intrinsics)
    spread = _size_covariance(camera, sheet) if fit is None else fit.size_covariance
    camera, sheet = (replace(step, size_covariance=spread) for step in (camera, sheet))
    first, second = influence(camera, names, "camera"), influence(sheet, sheets, blamed)
    both = chained(first, second, *by_camera(camera, sheet, names, sheets))
    joined = replace(camera, noise=sheet.noise)
    return Outcome(sheet.state, both, (camera, sheet), joined, weak)


def _known(noise: NoiseModel) -> NoiseModel:
    return replace(noise, free=np.zeros_like(noise.free))


def _size_covariance(camera: Fit, sheet: Fit) -> Array:
    """The camera stage told the pixel noise, the in-plane views the placement noise."""
    spread = sheet.size_covariance.copy()
    spread[PIXEL, PIXEL] = camera.size_covariance[PIXEL, PIXEL]
    return spread
