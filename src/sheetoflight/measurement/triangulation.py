"""Points on the sheet of light from their image points (the paper's eqs. 20–23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import AnyCalibration, SheetCalibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import PLANE_PARTS, SHEET_MAP_PARTS
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_map import SheetMap


@dataclass(frozen=True)
class TriangulatedPoints:
    """Points with their derivatives.

    Parameters
    ----------
    xyz : (N, 3) array
        mm, camera frame; NaN where the ray does not meet the sheet in front of the camera.
    by_pixel : (N, 3, 2) array
        mm per px.
    by_parameter : (N, 3, P) array
        mm per unit of `parameter_names`.
    """

    xyz: Array
    by_pixel: Array
    by_parameter: Array


def parameter_names(sheet: LightPlane | SheetMap) -> tuple[str, ...]:
    """Names, as in `Calibration.covariance`, of the ten camera and four plane parameters, or of
    the five of a sheet map."""
    if isinstance(sheet, SheetMap):
        return tuple(f"{sheet.name}.{part}" for part in SHEET_MAP_PARTS)
    camera = tuple(f"camera.{name}" for name in Camera.PARAMETERS)
    return (*camera, *(f"{sheet.name}.{part}" for part in PLANE_PARTS))


def triangulate(calibration: AnyCalibration, uv: Array, laser: str | None = None) -> Array:
    """Image points on the laser line to points in space: ``X = d r / (n · r)``.

    Parameters
    ----------
    calibration : Calibration
    uv : (N, 2) or (2,) array
        Image points in px.
    laser : str, optional
        In whose sheet they lie; may be left out where there is one laser.

    Returns
    -------
    (N, 3) or (3,) array
        mm, camera frame – of a camera-free calibration, the sheet's own; NaN where the ray does
        not meet the sheet in front of the camera.

    Raises
    ------
    InputError
        If `uv` does not hold pairs of numbers, or the laser is not known.
    """
    pixels = checked_pixels(uv)
    if isinstance(calibration, SheetCalibration):
        return calibration.sheet(laser).points(pixels)
    return calibration.sheet(laser).intersect(calibration.camera.unproject(pixels))


def checked_pixels(uv: Array) -> Array:
    """Image points as a float array ``(..., 2)``."""
    try:
        pixels = np.asarray(uv, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"image points are {uv!r}", "give pairs of numbers u and v") from error
    if pixels.ndim == 0 or pixels.shape[-1] != 2:
        raise InputError(
            f"image points have shape {pixels.shape}, expected (N, 2)", "give pairs of u and v"
        )
    return pixels


def triangulate_with_jacobians(
    calibration: AnyCalibration, uv: Array, laser: str | None = None
) -> TriangulatedPoints:
    """`triangulate` for ``(N, 2)`` image points, with derivatives.

    From ``t = d / (n · r)`` and ``X = t r``: ``dX = (I − r nᵀ/(n · r)) t dr − r t (r · dn)/(n · r)
    + r dd/(n · r)``.
    """
    if isinstance(calibration, SheetCalibration):
        return TriangulatedPoints(
            *calibration.sheet(laser).points_with_jacobians(checked_pixels(uv))
        )
    plane = calibration.sheet(laser)
    rays, ray_by_pixel, ray_by_camera = calibration.camera.unproject_with_jacobians(
        checked_pixels(uv)
    )
    xyz = plane.intersect(rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = rays @ plane.normal
        along = rays / slope[:, None]
        depth = xyz[:, 2]  # rays have z = 1
        by_ray = depth[:, None, None] * (np.eye(3) - along[:, :, None] * plane.normal)
        by_parameter = np.empty((len(xyz), 3, 14))
        by_parameter[..., :10] = by_ray[..., :2] @ ray_by_camera
        by_parameter[..., 10:13] = -depth[:, None, None] * along[:, :, None] * rays[:, None, :]
        by_parameter[..., 13] = along
    return TriangulatedPoints(xyz, by_ray[..., :2] @ ray_by_pixel, by_parameter)
