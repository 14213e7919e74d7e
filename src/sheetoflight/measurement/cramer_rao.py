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
from sheetoflight.calibration.self_generated_fit import SheetFit, fitted_sheet
from sheetoflight.calibration.self_generated_method import placed_points, self_generated
from sheetoflight.model.calibration import AnyCalibration, Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.rig import Rig


def bounding_calibration(
    rig: Rig,
    pixel_std: float,
    line_std: float,
    method: str = "joint",
    camera: Rig | None = None,
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
    camera : Rig, optional
        Other views, exact too, that tell the camera alone; those of `rig` are then points whose
        places in the sheet a stage tells. The bound is that of both together.

    Raises
    ------
    UntrustworthyError
        If the views do not determine the rig.
    """
    if method == CAMERA_FREE:
        return camera_free(replace(rig, pixel_std=pixel_std))
    if camera is not None:
        known = _of_camera_and_sheet(camera, pixel_std, line_std)
        return _with_places(rig, known, pixel_std)
    return _of_camera_and_sheet(rig, pixel_std, line_std)


def _of_camera_and_sheet(rig: Rig, pixel_std: float, line_std: float) -> Calibration:
    start = screened_boards(rig).state if len(rig.observations.board) else None
    variances = np.zeros(len(COMPONENTS))
    variances[[PIXEL, CORNER]] = pixel_std**2
    variances[STRIPE] = line_std**2
    plain = replace(rig, pixel_std=pixel_std, placement_std=0.0)
    known = replace(noise_model(plain), variances=variances, free=np.zeros(len(variances), bool))
    return calibration_of("joint", plain, joint(plain, known, start=start), 1.0, ())


def _with_places(rig: Rig, known: Calibration, pixel_std: float) -> Calibration:
    """Of points whose places in the sheet a stage tells, and of the views behind a camera.

    With the camera's covariance as both together leave it, the sheet that follows from a held
    camera has the covariance that both together leave: the blocks of an inverse, the pose being
    eliminated first.
    """
    held = replace(
        rig, pixel_std=pixel_std, camera=known.camera, camera_covariance=known.covariance
    )
    both = _camera_of_both(fitted_sheet(placed_points(held)), pixel_std)
    return self_generated(replace(held, camera_covariance=both))


def _camera_of_both(fit: SheetFit, pixel_std: float) -> Covariance:
    """Of the camera, once the points that the held one was used on have their say too.

    They add the information ``Lᵀ L / σ²``, L being what the pose leaves of the derivatives by
    the camera: ``(C⁻¹ + Lᵀ L / σ²)⁻¹ = C − C Lᵀ (L C Lᵀ + σ² I)⁻¹ L C`` by the matrix inversion
    lemma, which needs no inverse of C.
    """
    before, left = fit.seen.camera_matrix, fit.camera_left
    moved = left @ before
    spread = moved @ left.T + pixel_std**2 * np.eye(len(left))
    matrix = before - moved.T @ np.linalg.solve(spread, moved)
    return Covariance(fit.seen.camera_names, 0.5 * (matrix + matrix.T))
