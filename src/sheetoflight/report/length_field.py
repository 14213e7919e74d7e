"""How well a length is known, place by place across the sheet of light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.length import lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.report.numbers import two_digits

_COLUMNS, _ROWS = 7, 5
_LENGTHS_MM = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
_ENOUGH = 0.5
_DIRECTIONS = ("along the picture's rows", "along the picture's columns")


@dataclass(frozen=True)
class LengthField:
    """Expected standard uncertainty of a length at a grid of image points.

    Parameters
    ----------
    length_mm : float
    u : (C,) array, v : (R,) array
        The grid, px; the middle of the length is seen there.
    depth_mm : (R, C) array
        Z of the sheet; NaN where the ray does not meet it.
    depth_range_mm : (float, float)
        Nearest and farthest Z of the targets that lay in the sheet; all depths where none did.
    std_mm : (2, R, C) array
        For the length lying in the sheet along the picture's rows, and along its columns; NaN
        where it leaves the picture or the sheet.
    """

    length_mm: float
    u: Array
    v: Array
    depth_mm: Array
    depth_range_mm: tuple[float, float]
    std_mm: Array

    @property
    def calibrated(self) -> np.ndarray:
        """``(R, C)`` mask of the places within `depth_range_mm`."""
        nearest, farthest = self.depth_range_mm
        with np.errstate(invalid="ignore"):
            return (self.depth_mm >= nearest) & (self.depth_mm <= farthest)

    @property
    def representative_std_mm(self) -> Array:
        """The uncertainties within `depth_range_mm`; all of them where none lies there."""
        inside = self.std_mm[:, self.calibrated]
        inside = inside[np.isfinite(inside)]
        return inside if len(inside) else self.std_mm[np.isfinite(self.std_mm)]


def length_field(calibration: Calibration) -> LengthField | None:
    """The uncertainty of 100 mm across the picture; a shorter length where that does not fit.

    The longest length of 100, 50, 20 … mm is taken that lies in the picture at half of the
    places and directions. None where even 0.1 mm does not, or the sheet is not seen, or the
    calibration carries no covariance: image noise alone would promise too much.
    """
    if not calibration.covariance.parameters:
        return None
    width, height = calibration.camera.image_size
    u = (np.arange(_COLUMNS) + 0.5) * width / _COLUMNS - 0.5
    v = (np.arange(_ROWS) + 0.5) * height / _ROWS - 0.5
    centres = np.stack(np.meshgrid(u, v), axis=-1)
    middle = calibration.triangulate(centres.reshape(-1, 2)).reshape(_ROWS, _COLUMNS, 3)
    along = np.stack([_tangents(calibration, centres, axis) for axis in (0, 1)])
    seen = int(np.isfinite(along).all(axis=-1).sum())
    for length_mm in _LENGTHS_MM:
        ends = _ends_in_picture(calibration, middle, along, length_mm)
        fits = np.isfinite(ends).all(axis=(-1, -2))
        if seen and fits.sum() >= _ENOUGH * seen:
            std = np.full(fits.shape, np.nan)
            std[fits] = [found.std for found in lengths(calibration, ends[fits])]
            return LengthField(length_mm, u, v, middle[..., 2], _depth_range(calibration), std)
    return None


def _depth_range(calibration: Calibration) -> tuple[float, float]:
    placed = [view.xyz[:, 2] for view in calibration.residuals.views if view.stage == "plane"]
    depths = np.concatenate([np.empty(0), *placed])
    depths = depths[np.isfinite(depths)]
    return (float(depths.min()), float(depths.max())) if len(depths) else (0.0, np.inf)


def _tangents(calibration: Calibration, centres: Array, axis: int) -> Array:
    """Unit directions ``(R, C, 3)`` in the sheet that appear along u (axis 0) or v (axis 1)."""
    step = np.zeros(2)
    step[axis] = 0.5
    before = calibration.triangulate((centres - step).reshape(-1, 2))
    after = calibration.triangulate((centres + step).reshape(-1, 2))
    return normalised(after - before).reshape(*centres.shape[:2], 3)


def _ends_in_picture(
    calibration: Calibration, middle: Array, along: Array, length_mm: float
) -> Array:
    """Image points ``(2, R, C, 2, 2)`` of both ends; NaN where one leaves the picture."""
    half = 0.5 * length_mm * along
    ends = calibration.camera.project(np.stack([middle - half, middle + half], axis=-2))
    last = np.array(calibration.camera.image_size) - 0.5
    with np.errstate(invalid="ignore"):
        inside = ((ends >= -0.5) & (ends <= last)).all(axis=(-1, -2), keepdims=True)
    return np.where(inside, ends, np.nan)


@dataclass(frozen=True)
class FieldSummary:
    """A length field in a few texts: mm, and the depths they hold for."""

    length: str
    best: str
    median: str
    worst: str
    depths: str


@dataclass(frozen=True)
class FieldCell:
    """One place: the uncertainty and depth as text, a shade from 0 to 1, and whether targets
    stood at this depth."""

    std: str
    depth: str
    shade: float
    calibrated: bool


@dataclass(frozen=True)
class FieldTable:
    """A length field in one direction: headings u, and rows of v with their cells."""

    direction: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[FieldCell, ...]], ...]


def summary(field: LengthField | None) -> FieldSummary | None:
    """What the headline says, for the depths at which targets stood."""
    if field is None:
        return None
    std = field.representative_std_mm
    nearest, farthest = field.depth_range_mm
    return FieldSummary(
        length=f"{field.length_mm:g}",
        best=two_digits(float(std.min())),
        median=two_digits(float(np.median(std))),
        worst=two_digits(float(std.max())),
        depths=f"Z {nearest:.0f} to {farthest:.0f} mm" if np.isfinite(farthest) else "",
    )


def field_tables(field: LengthField | None) -> tuple[FieldTable, ...]:
    """One table for each direction."""
    if field is None:
        return ()
    columns = tuple(f"{u:.0f}" for u in field.u)
    return tuple(
        FieldTable(
            direction,
            columns,
            tuple((f"{v:.0f}", _cells(field, axis, row)) for row, v in enumerate(field.v)),
        )
        for axis, direction in enumerate(_DIRECTIONS)
    )


def _cells(field: LengthField, axis: int, row: int) -> tuple[FieldCell, ...]:
    darkest = float(field.representative_std_mm.max())
    cells = []
    for column in range(len(field.u)):
        std, depth = float(field.std_mm[axis, row, column]), float(field.depth_mm[row, column])
        known = np.isfinite(std)
        shade = min(std / darkest, 1.0) if known and darkest > 0 else 0.0
        cells.append(
            FieldCell(
                std=two_digits(std) if known else "–",
                depth=f"Z {depth:.0f}" if np.isfinite(depth) else "",
                shade=round(shade, 3),
                calibrated=bool(field.calibrated[row, column]),
            )
        )
    return tuple(cells)
