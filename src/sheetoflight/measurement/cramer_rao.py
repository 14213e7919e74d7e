"""The smallest uncertainty that any unbiased method can reach on given views (Cramér–Rao)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.camera_free_method import camera_free
from sheetoflight.calibration.components import COMPONENTS, CORNER, PIXEL, STRIPE
from sheetoflight.calibration.joint_method import joint
from sheetoflight.calibration.methods import CAMERA_FREE
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.result import calibration_of
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.rig import Rig


def bounding_calibration(
    rig: Rig, pixel_std: float, line_std: float, method: str = "joint"
) -> AnyCalibration:
    """The calibration whose covariance is the inverse of the information in the views.

    Every other method that is given the same views is bounded by it, whichever way it takes. The
    information is that at the rig's true values, so the views must be without noise. Sizes of the
    noise are taken as known: to first order it makes no difference whether they are (S. M. Kay,
    Fundamentals of Statistical Signal Processing: Estimation Theory, eq. 3.31).

    Parameters
    ----------
    rig : Rig
        Its observations are exact, and targets in stage plane lie in the sheet.
    pixel_std, line_std : float
        Standard deviation of the image coordinates of points that the views stand for, and of a
        line's points across the line, px.
    method : str
        ``camera-free`` for the bound without a camera.

    Raises
    ------
    UntrustworthyError
        If the views do not determine the rig.
    """
    if method == CAMERA_FREE:
        return camera_free(replace(rig, pixel_std=pixel_std))
    start = screened_boards(rig).state if len(rig.observations.board) else None
    variances = np.zeros(len(COMPONENTS))
    variances[[PIXEL, CORNER]] = pixel_std**2
    variances[STRIPE] = line_std**2
    plain = replace(rig, pixel_std=pixel_std, placement_std=0.0)
    known = replace(noise_model(plain), variances=variances, free=np.zeros(len(variances), bool))
    return calibration_of("joint", plain, joint(plain, known, start=start), 1.0, ())
