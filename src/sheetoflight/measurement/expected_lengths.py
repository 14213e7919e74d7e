"""Lengths at a grid of places all over the picture, and how they depend on the calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.triangulation import triangulate, triangulate_with_jacobians
from sheetoflight.model.calibration import Calibration

DIRECTIONS = ("along the picture's rows", "along the picture's columns")
"""How the lengths of a grid lie in the sheet, as the picture shows them."""

_PROBES = 100


@dataclass(frozen=True)
class LengthGrid:
    """A length laid into a sheet at a grid of places, in two directions.

    Parameters
    ----------
    laser : str
    length_mm : float
    u : (C,) array, v : (R,) array
        The middle of the length is seen there, px; spread over the part of the picture which
        shows the sheet within the depths.
    depth_mm : (R, C) array
        Z of the sheet there; NaN where the ray does not meet it.
    fits : (2, R, C) mask
        Where the middle lies within the depths that are asked for and both ends in the picture,
        for each of `DIRECTIONS`. The F lengths below are those, in this order.
    ends : (F, 2, 2) array
        Image points of the ends, px.
    by_pixel : (F, 2, 2) array
        Derivatives of the length by u and v of both ends, mm per px.
    by_parameter : (F, 14) array
        By the camera's ten parameters and nx, ny, nz, d of the sheet, mm per unit.
    """

    laser: str
    length_mm: float
    u: Array
    v: Array
    depth_mm: Array
    fits: np.ndarray
    ends: Array
    by_pixel: Array
    by_parameter: Array

    @property
    def asked(self) -> int:
        """Places and directions at which the sheet is seen within the depths."""
        return 2 * int(np.isfinite(self.depth_mm).sum())

    def spread(self, values: Array) -> Array:
        """F values at their places ``(2, R, C)``; NaN elsewhere."""
        grid = np.full(self.fits.shape, np.nan)
        grid[self.fits] = values
        return grid

    def image_variances(self, pixel_std: float) -> Array:
        """Variances ``(F,)`` that the noise of the ends' image points brings, mm²."""
        return pixel_std**2 * np.sum(self.by_pixel**2, axis=(1, 2))


def length_grid(
    calibration: Calibration,
    laser: str,
    length_mm: float,
    depth_mm: tuple[float, float],
    columns: int,
    rows: int,
) -> LengthGrid:
    """A length at a grid of places.

    Parameters
    ----------
    calibration : Calibration
        Camera and sheets; its covariance is not looked at.
    laser : str
    length_mm : float
    depth_mm : (float, float)
        Nearest and farthest Z of the middle of the length.
    columns, rows : int
    """
    u, v = _seen_part(calibration, laser, depth_mm, columns, rows)
    centres = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    middle = triangulate(calibration, centres, laser)
    middle[~_within(middle[:, 2], depth_mm)] = np.nan
    along = np.stack([_tangents(calibration, laser, centres, axis) for axis in (0, 1)])
    half = 0.5 * length_mm * along
    ends = calibration.camera.project(np.stack([middle - half, middle + half], axis=-2))
    last = np.array(calibration.camera.image_size) - 0.5
    with np.errstate(invalid="ignore"):
        fits = ((ends >= -0.5) & (ends <= last)).all(axis=(-1, -2))
    by_pixel, by_parameter = _derivatives(calibration, laser, ends[fits])
    return LengthGrid(
        laser,
        length_mm,
        u,
        v,
        middle[:, 2].reshape(rows, columns),
        fits.reshape(2, rows, columns),
        ends[fits],
        by_pixel,
        by_parameter,
    )


def _within(depth: Array, depth_mm: tuple[float, float]) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return (depth >= depth_mm[0]) & (depth <= depth_mm[1])


def _seen_part(
    calibration: Calibration,
    laser: str,
    depth_mm: tuple[float, float],
    columns: int,
    rows: int,
) -> tuple[Array, Array]:
    """Columns and rows that spread over the part of the picture which shows the sheet within
    the depths; over all of it where none does."""
    width, height = calibration.camera.image_size
    axes = [np.linspace(-0.5, size - 0.5, _PROBES) for size in (width, height)]
    probes = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    seen = probes[_within(triangulate(calibration, probes, laser)[:, 2], depth_mm)]
    seen = seen if len(seen) else probes
    low, high = seen.min(axis=0), seen.max(axis=0)
    u = low[0] + (np.arange(columns) + 0.5) * (high[0] - low[0]) / columns
    v = low[1] + (np.arange(rows) + 0.5) * (high[1] - low[1]) / rows
    return u, v


def _tangents(calibration: Calibration, laser: str, centres: Array, axis: int) -> Array:
    """Unit directions ``(N, 3)`` in the sheet that appear along u (axis 0) or v (axis 1)."""
    step = np.zeros(2)
    step[axis] = 0.5
    before = triangulate(calibration, centres - step, laser)
    return normalised(triangulate(calibration, centres + step, laser) - before)


def _derivatives(calibration: Calibration, laser: str, ends: Array) -> tuple[Array, Array]:
    points = triangulate_with_jacobians(calibration, ends.reshape(-1, 2), laser)
    xyz = points.xyz.reshape(-1, 2, 3)
    direction = normalised(xyz[:, 1] - xyz[:, 0])
    along = np.stack([-direction, direction], axis=1)[:, :, None, :]
    return (
        (along @ points.by_pixel.reshape(-1, 2, 3, 2))[:, :, 0],
        (along @ points.by_parameter.reshape(-1, 2, 3, 14))[:, :, 0].sum(axis=1),
    )
