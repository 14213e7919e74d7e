"""Points on the sheet of light from their image points (the paper's eqs. 20–23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import AnyCalibration, SheetCalibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import SHEET_MAP_PARTS
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
    """Names, as in `Calibration.covariance`, of the ten camera and four plane parameters, and of
    the three of a curved sheet; or of the five of a sheet map."""
    if isinstance(sheet, SheetMap):
        return tuple(f"{sheet.name}.{part}" for part in SHEET_MAP_PARTS)
    camera = tuple(f"camera.{name}" for name in Camera.PARAMETERS)
    return (*camera, *sheet.parameters)


def triangulate(calibration: AnyCalibration, uv: Array, laser: str | None = None) -> Array:
    """Image points on the laser line to points in space: ``X = d r / (n · r)``.

    On a curved sheet X is where the ray meets it (`LightPlane.intersect`).

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


def is_curved(calibration: AnyCalibration, laser: str | None = None) -> bool:
    """Whether the sheet of a laser is curved, so that no line in it is straight."""
    sheet = calibration.sheet(laser)
    return isinstance(sheet, LightPlane) and sheet.curvature is not None


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

    A point ``X = t r`` stays on the sheet, ``f(X) = 0``, so that with the gradient ``g = ∂f/∂X``
    (`LightPlane.gradients`; n on a flat sheet) and the sheet's parameters p:
    ``dX = t (I − r gᵀ/(g · r)) dr − r ∂f/∂p dp / (g · r)``, where ``∂f/∂n = X``, ``∂f/∂d = −1``
    and ``∂f/∂k = −(½ x², x y, ½ y²)``.
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
    gradient = plane.gradients(xyz)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = rays / np.sum(gradient * rays, axis=1)[:, None]
        depth = xyz[:, 2]  # rays have z = 1
        by_ray = depth[:, None, None] * (np.eye(3) - along[:, :, None] * gradient[:, None, :])
        by_camera = by_ray[..., :2] @ ray_by_camera
        by_sheet = along[:, :, None] * _moved_by_sheet(plane, xyz)[:, None, :]
    by_parameter = np.concatenate([by_camera, by_sheet], axis=-1)
    return TriangulatedPoints(xyz, by_ray[..., :2] @ ray_by_pixel, by_parameter)


def _moved_by_sheet(plane: LightPlane, xyz: Array) -> Array:
    """``−∂f/∂p`` ``(N, 4 or 7)``: how far each of the sheet's parameters moves it at points."""
    parts = [-xyz, np.ones((len(xyz), 1))]
    if plane.curvature is not None:
        parts.append(plane.curvature.heights_by_per_mm(xyz))
    return np.concatenate(parts, axis=1)
