"""One calibration of a simulated rig held against the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.length import coverage_factor, lengths
from sheetoflight.model.calibration import AnyCalibration, SheetCalibration
from sheetoflight.model.light_plane import LightPlane


@dataclass(frozen=True, eq=False)
class Yardstick:
    """What every calibration of a simulated rig is held against.

    Parameters
    ----------
    plane : LightPlane
        The true sheet, camera frame.
    points : (P, 3) array
        Points of it all over the working volume, mm.
    lengths_mm : (L,) array
    uv : (L, S, 2, 2) array
        Exact image points of both ends of S segments of each length, px.
    """

    plane: LightPlane
    points: Array
    lengths_mm: Array
    uv: Array


@dataclass(frozen=True, eq=False)
class LengthErrors:
    """What a calibration makes of the yardstick's segments.

    Parameters
    ----------
    error_mm, std_mm : (L, S) arrays
        Measured minus true, and the standard uncertainty stated for it.
    held : (L, S) mask
        Whether the 95 % interval covers the true length.
    """

    error_mm: Array
    std_mm: Array
    held: np.ndarray


@dataclass(frozen=True, eq=False)
class Attempt:
    """One method in one trial.

    Parameters
    ----------
    name : str
        The contestant's.
    refused : str
        Why there is no result, in the refusal's own words; else empty, and all that follows is
        there.
    seconds : float
        How long the calibration took.
    normal_deg, plane_mm : float
        Angle between found and true normal, degrees, and the root mean square distance between
        found and true sheet, mm; NaN of a method that knows no camera.
    calibration : LengthErrors, optional
        Of lengths whose ends' image points are exact: the calibration's share.
    measured : LengthErrors, optional
        Of the same lengths with noise in the ends' image points.
    bound_mm : (L, S) array, optional
        The least standard deviation of the calibration's share.
    """

    name: str
    refused: str = ""
    seconds: float = math.nan
    normal_deg: float = math.nan
    plane_mm: float = math.nan
    calibration: LengthErrors | None = None
    measured: LengthErrors | None = None
    bound_mm: Array | None = None


def plane_errors(calibration: AnyCalibration, yardstick: Yardstick) -> tuple[float, float]:
    """Angle between the normals in degrees and rms distance of the sheets in mm; NaN of a method
    that knows no camera, whose sheet has no place in space.

    The normals of curved sheets are those amid the yardstick's points.
    """
    if isinstance(calibration, SheetCalibration):
        return math.nan, math.nan
    found = calibration.light_planes[0]
    middle = yardstick.points.reshape(-1, 3).mean(axis=0)
    normal, true = found.normals_at(middle), yardstick.plane.normals_at(middle)
    sine = float(np.linalg.norm(np.cross(normal, true)))
    angle = math.degrees(math.atan2(sine, float(normal @ true)))
    off = found.heights(yardstick.points)
    return angle, float(np.sqrt(np.mean(off**2)))


def calibration_errors(calibration: AnyCalibration, yardstick: Yardstick) -> LengthErrors:
    """Errors of the yardstick's lengths, their ends seen exactly.

    Raises
    ------
    InputError
        If an end does not lie on the sheet that was found.
    """
    return _errors(calibration, yardstick, yardstick.uv, 0.0)


def measured_errors(
    calibration: AnyCalibration, yardstick: Yardstick, noise_px: Array, end_std: float | None
) -> LengthErrors:
    """Errors of the yardstick's lengths, their ends seen with noise.

    Parameters
    ----------
    calibration : Calibration or SheetCalibration
    yardstick : Yardstick
    noise_px : (L, S, 2, 2) array
        What is added to the ends' image points.
    end_std : float, optional
        What the ends are said to be uncertain by; the calibration's own noise where absent.

    Raises
    ------
    InputError
        As for `calibration_errors`.
    """
    return _errors(calibration, yardstick, yardstick.uv + noise_px, end_std)


def bound_mm(bounding: AnyCalibration, yardstick: Yardstick) -> Array:
    """Least standard deviation ``(L, S)`` of the lengths' errors, by `bounding_calibration`."""
    return calibration_errors(bounding, yardstick).std_mm


def _errors(
    calibration: AnyCalibration, yardstick: Yardstick, uv: Array, std_px: float | None
) -> LengthErrors:
    shape = uv.shape[:2]
    stated = None if std_px is None else np.full(shape, std_px).ravel()
    found = lengths(calibration, uv.reshape(-1, 2, 2), stated)
    value, std = (np.reshape([getattr(one, of) for one in found], shape) for of in ("value", "std"))
    reach = np.reshape([coverage_factor(one.degrees_of_freedom) for one in found], shape) * std
    error = value - yardstick.lengths_mm[:, None]
    return LengthErrors(error, std, np.abs(error) <= reach)
