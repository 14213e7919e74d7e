"""Lengths between points on the sheet of light, with their uncertainty (the paper's eq. 24)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.triangulation import (
    TriangulatedPoints,
    checked_pixels,
    parameter_names,
    triangulate_with_jacobians,
)
from sheetoflight.model.calibration import AnyCalibration, SheetCalibration

IMAGE_POINTS = "image points"
"""What the noise of the measured points themselves is called in a budget."""

_TAIL = 0.025
"""Part of the distribution beyond either end of a 95 % interval."""


def coverage_factor(degrees_of_freedom: float) -> float:
    """Half width of a 95 % interval in standard uncertainties: Student's quantile (GUM, G.3)."""
    if math.isinf(degrees_of_freedom):
        return float(-ndtri(_TAIL))
    return float(-stdtrit(degrees_of_freedom, _TAIL))


@dataclass(frozen=True)
class Length:
    """A measured length in mm.

    Parameters
    ----------
    value, std : float
        The length and its standard uncertainty.
    budget : tuple of (str, float)
        What `std` is made of: standard uncertainties by source, adding in squares.
    degrees_of_freedom : float
        Effective ones of `std`; infinite where the noise was stated, not estimated.
    """

    value: float
    std: float
    budget: tuple[tuple[str, float], ...] = ()
    degrees_of_freedom: float = math.inf

    @property
    def calibration_std(self) -> float:
        """What is left of `std` where the image points are free of noise."""
        return math.sqrt(sum(part**2 for name, part in self.budget if name != IMAGE_POINTS))

    @property
    def interval(self) -> tuple[float, float]:
        """Low and high end of the 95 % interval, mm."""
        reach = coverage_factor(self.degrees_of_freedom) * self.std
        return self.value - reach, self.value + reach


def length(
    calibration: AnyCalibration,
    uv_1: Array,
    uv_2: Array,
    std_px: float | None = None,
    laser: str | None = None,
) -> Length:
    """Distance between two image points on the laser line.

    Parameters
    ----------
    calibration : Calibration or SheetCalibration
    uv_1, uv_2 : (2,) arrays
        Image points in px.
    std_px : float, optional
        Standard uncertainty of each image coordinate; the calibration's own where absent.
    laser : str, optional
        In whose sheet the points lie; may be left out where there is one laser.

    Raises
    ------
    InputError
        If a point lies outside the picture, or its ray does not meet the sheet in front of
        the camera.
    """
    ends = np.stack([checked_pixels(uv_1), checked_pixels(uv_2)])
    if ends.shape != (2, 2):
        raise InputError(
            f"the ends have shapes {np.shape(uv_1)} and {np.shape(uv_2)}, expected (2,) each",
            "give one u and v for each end; use triangulate for many points",
        )
    if std_px is not None and not (np.isfinite(std_px) and std_px >= 0):
        raise InputError(f"std_px is {std_px}", "give a standard uncertainty in px")
    std = None if std_px is None else np.array([std_px])
    return lengths(calibration, ends[None], std, laser=laser)[0]


def lengths(
    calibration: AnyCalibration,
    ends: Array,
    std_px: Array | None = None,
    names: tuple[str, ...] | None = None,
    laser: str | None = None,
) -> list[Length]:
    """Lengths of many segments in one sheet.

    Parameters
    ----------
    calibration : Calibration or SheetCalibration
    ends : (N, 2, 2) array
        Both image points of each segment in px.
    std_px : (N,) or (N, 2) array, optional
        Standard uncertainty of the ends' image coordinates, px.
    names : tuple of str, optional
        What to call the segments in errors.
    laser : str, optional
        In whose sheet they lie; may be left out where there is one laser.

    Raises
    ------
    InputError
        As for `length`, naming the segment and its end.
    """
    if not len(ends):
        return []
    names = names or tuple(str(index + 1) for index in range(len(ends)))
    change = _changes(calibration, ends, names, laser)
    noise = np.full((len(ends), 2), calibration.pixel_std)
    if std_px is not None:
        noise[:] = np.broadcast_to(np.reshape(std_px, (len(ends), -1)), noise.shape)
    shares = _shares(calibration, change, noise, stated=std_px is not None)
    return [
        _length(calibration, float(value), [(name, c, float(v[i])) for name, c, v in shares])
        for i, value in enumerate(change.values)
    ]


@dataclass(frozen=True)
class LengthChanges:
    """N lengths in mm and their derivatives.

    Parameters
    ----------
    values : (N,) array
        mm.
    by_pixel : (N, 2, 2) array
        By u and v of both ends, mm per px.
    by_parameter : (N, P) array
        By `names`, mm per unit.
    names : tuple of str
    """

    values: Array
    by_pixel: Array
    by_parameter: Array
    names: tuple[str, ...]


def _changes(
    calibration: AnyCalibration, ends: Array, names: tuple[str, ...], laser: str | None
) -> LengthChanges:
    points = triangulate_with_jacobians(calibration, ends.reshape(-1, 2), laser)
    _refuse_points_off_the_sheet(calibration, ends, points, names)
    xyz = points.xyz.reshape(-1, 2, 3)
    difference = xyz[:, 1] - xyz[:, 0]
    values = np.linalg.norm(difference, axis=1)
    if not (values > 0).all():
        raise InputError(
            f"segment {names[int(np.argmin(values))]}: both ends are the same point",
            "give two different points on the laser line",
        )
    direction = difference / values[:, None]
    along = np.stack([-direction, direction], axis=1)[:, :, None, :]
    sheet_names = parameter_names(calibration.sheet(laser))
    return LengthChanges(
        values,
        (along @ points.by_pixel.reshape(-1, 2, 3, 2))[:, :, 0],
        (along @ points.by_parameter.reshape(-1, 2, 3, len(sheet_names)))[:, :, 0].sum(axis=1),
        sheet_names,
    )


def _shares(
    calibration: AnyCalibration, change: LengthChanges, noise: Array, stated: bool
) -> list[tuple[str, str | None, Array]]:
    """Variances by source: its name, the noise component it goes with, and ``(N,)`` mm²."""
    covariance = calibration.covariance
    shares: list[tuple[str, str | None, Array]] = []
    for source in covariance.parts():
        block = covariance.block(change.names, source.matrix)
        part = np.einsum("ni,ij,nj->n", change.by_parameter, block, change.by_parameter)
        shares.append((source.name, source.component, np.maximum(part, 0.0)))
    own = None if stated else "pixel"
    image = np.sum((change.by_pixel * noise[..., None]) ** 2, axis=(1, 2))
    return [*shares, (IMAGE_POINTS, own, image)]


def _length(
    calibration: AnyCalibration, value: float, shares: list[tuple[str, str | None, float]]
) -> Length:
    total = sum(part for _, _, part in shares)
    by_source: dict[str, float] = {}
    by_component: dict[str, float] = {}
    for name, component, part in shares:
        by_source[name] = by_source.get(name, 0.0) + part
        if component:
            by_component[component] = by_component.get(component, 0.0) + part
    freedom = calibration.covariance.components.degrees_of_freedom(total, by_component)
    budget = tuple((name, math.sqrt(part)) for name, part in by_source.items())
    return Length(value, math.sqrt(total), budget, freedom)


def _refuse_points_off_the_sheet(
    calibration: AnyCalibration, ends: Array, points: TriangulatedPoints, names: tuple[str, ...]
) -> None:
    width, height = calibration.image_size
    camera = None if isinstance(calibration, SheetCalibration) else calibration.camera
    rays = ends if camera is None else camera.unproject(ends)
    for index, name in enumerate(names):
        for end in range(2):
            u, v = ends[index, end]
            where = f"segment {name}: point {end + 1} at ({u:g}, {v:g})"
            if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
                raise InputError(
                    f"{where} lies outside the {width}×{height} picture",
                    "give pixels of the calibrated camera's picture",
                )
            if not np.isfinite(rays[index, end]).all():
                raise InputError(
                    f"{where} lies beyond the part of the picture that the lens model describes",
                    "calibrate with targets that reach into this part of the picture",
                )
            if not np.isfinite(points.xyz.reshape(-1, 2, 3)[index, end]).all():
                raise InputError(
                    f"{where} looks away from the sheet of light: its ray meets the sheet only "
                    "behind the camera",
                    "check that the point lies on the laser line, and the calibration",
                )
