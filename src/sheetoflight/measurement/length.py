"""Lengths between points on the sheet of light, with their uncertainty (the paper's eq. 24)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.triangulation import (
    TriangulatedPoints,
    checked_pixels,
    parameter_names,
    triangulate_with_jacobians,
)
from sheetoflight.model.calibration import Calibration

NORMAL_95 = 1.959963984540054
"""Half width of the 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Length:
    """A measured length in mm.

    Parameters
    ----------
    value, std : float
        The length and its standard uncertainty.
    budget : tuple of (str, float)
        What `std` is made of: standard uncertainties by source, adding in squares.
    """

    value: float
    std: float
    budget: tuple[tuple[str, float], ...] = ()

    @property
    def interval(self) -> tuple[float, float]:
        """Low and high end of the 95 % interval, mm."""
        reach = NORMAL_95 * self.std
        return self.value - reach, self.value + reach


def length(
    calibration: Calibration, uv_1: Array, uv_2: Array, std_px: float | None = None
) -> Length:
    """Distance between two image points on the laser line.

    Parameters
    ----------
    calibration : Calibration
    uv_1, uv_2 : (2,) arrays
        Image points in px.
    std_px : float, optional
        Standard uncertainty of each image coordinate; the calibration's own where absent.

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
    return lengths(calibration, ends[None], None if std_px is None else np.array([std_px]))[0]


def lengths(
    calibration: Calibration,
    ends: Array,
    std_px: Array | None = None,
    names: tuple[str, ...] | None = None,
) -> list[Length]:
    """Lengths of many segments.

    Parameters
    ----------
    calibration : Calibration
    ends : (N, 2, 2) array
        Both image points of each segment in px.
    std_px : (N,) or (N, 2) array, optional
        Standard uncertainty of the ends' image coordinates, px.
    names : tuple of str, optional
        What to call the segments in errors.

    Raises
    ------
    InputError
        As for `length`, naming the segment and its end.
    """
    if not len(ends):
        return []
    names = names or tuple(str(index + 1) for index in range(len(ends)))
    points = triangulate_with_jacobians(calibration, ends.reshape(-1, 2))
    _refuse_points_off_the_sheet(calibration, ends, points, names)
    noise = np.full((len(ends), 2), calibration.pixel_std)
    if std_px is not None:
        noise[:] = np.broadcast_to(np.reshape(std_px, (len(ends), -1)), noise.shape)

    xyz = points.xyz.reshape(-1, 2, 3)
    difference = xyz[:, 1] - xyz[:, 0]
    values = np.linalg.norm(difference, axis=1)
    if not (values > 0).all():
        raise InputError(
            f"segment {names[int(np.argmin(values))]}: both ends are the same point",
            "give two different points on the laser line",
        )
    direction = difference / values[:, None]
    change = np.stack([-direction, direction], axis=1)[:, :, None, :]
    by_pixel = (change @ points.by_pixel.reshape(-1, 2, 3, 2))[:, :, 0]
    by_parameter = (change @ points.by_parameter.reshape(-1, 2, 3, 14))[:, :, 0].sum(axis=1)

    covariance = calibration.covariance.block(parameter_names(calibration.light_plane))
    scale_std = calibration.target.relative_tolerance if calibration.target else 0.0
    sources = {
        "calibration": np.sqrt(
            np.maximum(np.einsum("ni,ij,nj->n", by_parameter, covariance, by_parameter), 0.0)
        ),
        "image points": np.sqrt(np.sum((by_pixel * noise[..., None]) ** 2, axis=(1, 2))),
        "target length": values * scale_std,
    }
    return [
        Length(
            float(value),
            math.sqrt(sum(float(part[index]) ** 2 for part in sources.values())),
            tuple((source, float(part[index])) for source, part in sources.items()),
        )
        for index, value in enumerate(values)
    ]


def _refuse_points_off_the_sheet(
    calibration: Calibration, ends: Array, points: TriangulatedPoints, names: tuple[str, ...]
) -> None:
    width, height = calibration.camera.image_size
    rays = calibration.camera.unproject(ends)
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
