"""A rig before it is calibrated, in the adjustment's own terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.components import COMPONENTS, PIXEL, PLACEMENT
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import (
    ANCHOR,
    CAMERA,
    RigState,
    intrinsic_names,
    sheet_names,
)
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.nominal import NominalRig
from sheetoflight.model.rig import Rig


@dataclass(frozen=True)
class PlannedRig:
    """What a plan is made for.

    Parameters
    ----------
    rig : Rig
        Target, picture size, lens model; observations are not looked at.
    state : RigState
        The nominal rig, without poses.
    noise : NoiseModel
        Stated, none of it to be estimated.
    parameters : tuple of str
        The P shared parameters that the joint method would estimate.
    depth_mm : (float, float)
        Nearest and farthest Z of targets and lengths in a sheet.
    """

    rig: Rig
    state: RigState
    noise: NoiseModel
    parameters: tuple[str, ...]
    depth_mm: tuple[float, float]


def planned_rig(rig: Rig, nominal: NominalRig, pivoting: bool = True) -> PlannedRig:
    """A rig with its noise stated.

    Parameters
    ----------
    rig : Rig
    nominal : NominalRig
    pivoting : bool
        Whether there will be views of stage camera, so that the fixed point is estimated too.

    Raises
    ------
    InputError
        If the rig does not state the noise of its image points.
    """
    if rig.pixel_std is None:
        raise InputError("the rig states no pixel_std", "state the noise to plan with")
    normals = [plane.normal for plane in nominal.light_planes]
    state = RigState(
        nominal.camera,
        nominal.pivot_mm,
        np.array([np.stack([*tangent_basis(n), n], axis=1) for n in normals]),
        np.array([plane.distance_mm for plane in nominal.light_planes]),
        {},
    )
    variances = np.zeros(len(COMPONENTS))
    variances[PIXEL], variances[PLACEMENT] = rig.pixel_std**2, (rig.placement_std or 0.0) ** 2
    parameters = (
        *intrinsic_names(rig.free_intrinsics),
        *(ANCHOR if pivoting else ()),
        *sheet_names(len(rig.lasers)),
    )
    noise = NoiseModel({}, variances, np.zeros(len(COMPONENTS), dtype=bool))
    return PlannedRig(rig, state, noise, parameters, nominal.depth_mm)


def with_lens_of(planned: PlannedRig, calibration: Calibration) -> PlannedRig:
    """The same plan with those camera parameters free that a calibration estimated."""
    estimated = [name for name in CAMERA if name in calibration.covariance.parameters]
    if not estimated:
        return planned
    others = [name for name in planned.parameters if name not in CAMERA]
    return PlannedRig(
        planned.rig,
        planned.state,
        planned.noise,
        (*estimated, *others),
        planned.depth_mm,
    )
