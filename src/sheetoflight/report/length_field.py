"""How well a length is known, place by place across the sheet of light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.length import Length, lengths
from sheetoflight.measurement.triangulation import triangulate
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.report.numbers import two_digits
from sheetoflight.report.point_groups import in_sheet

_COLUMNS, _ROWS = 7, 5
_LENGTHS_MM = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
_ENOUGH = 0.5
_DIRECTIONS = ("along the picture's rows", "along the picture's columns")


@dataclass(frozen=True)
class LengthField:
    """Expected standard uncertainty of a length at a grid of image points.

    Parameters
    ----------
    laser : str
        Whose sheet of light it is.
    length_mm : float
    u : (C,) array, v : (R,) array
        The grid, px; the middle of the length is seen there.
    depth_mm : (R, C) array
        Z of the sheet; NaN where the ray does not meet it.
    depth_range_mm : (float, float)
        Nearest and farthest Z of the targets that lay in the sheet, or crossed it; all depths
        where none did.
    std_mm : (2, R, C) array
        For the length lying in the sheet along the picture's rows, and along its columns; NaN
        where it leaves the picture or the sheet.
    lengths : tuple of Length
        Those whose `std_mm` is known, in its order.
    """

    laser: str
    length_mm: float
    u: Array
    v: Array
    depth_mm: Array
    depth_range_mm: tuple[float, float]
    std_mm: Array
    lengths: tuple[Length, ...]

    @property
    def calibrated(self) -> np.ndarray:
        """``(R, C)`` mask of the places within `depth_range_mm`."""
        nearest, farthest = self.depth_range_mm
        with np.errstate(invalid="ignore"):
            return (self.depth_mm >= nearest) & (self.depth_mm <= farthest)

    @property
    def representative_std_mm(self) -> Array:
        """The uncertainties within `depth_range_mm`; all of them where none lies there."""
        return np.array([length.std for length in self._representative])

    @property
    def typical(self) -> Length:
        """The length whose uncertainty is nearest to the median of the representative ones."""
        median = float(np.median(self.representative_std_mm))
        return min(self._representative, key=lambda length: abs(length.std - median))

    @property
    def _representative(self) -> tuple[Length, ...]:
        inside = np.broadcast_to(self.calibrated, self.std_mm.shape)[np.isfinite(self.std_mm)]
        if not inside.any():
            return self.lengths
        return tuple(one for one, counts in zip(self.lengths, inside, strict=True) if counts)


def length_fields(calibration: Calibration) -> tuple[LengthField, ...]:
    """The field of each sheet of light that has one; see `length_field`."""
    fields = (length_field(calibration, laser) for laser in range(len(calibration.light_planes)))
    return tuple(field for field in fields if field is not None)


def length_field(calibration: Calibration, laser: int = 0) -> LengthField | None:
    """The uncertainty of 100 mm across the picture; a shorter length where that does not fit.

    The longest length of 100, 50, 20 … mm is taken that lies in the picture at half of the
    places and directions. None where even 0.1 mm does not, or the sheet is not seen, or the
    calibration carries no covariance: image noise alone would promise too much.
    """
    if not calibration.covariance.parameters:
        return None
    plane = calibration.light_planes[laser]
    width, height = calibration.camera.image_size
    u = (np.arange(_COLUMNS) + 0.5) * width / _COLUMNS - 0.5
    v = (np.arange(_ROWS) + 0.5) * height / _ROWS - 0.5
    centres = np.stack(np.meshgrid(u, v), axis=-1)
    middle = triangulate(calibration, centres.reshape(-1, 2), plane.name)
    middle = middle.reshape(_ROWS, _COLUMNS, 3)
    along = np.stack([_tangents(calibration, plane, centres, axis) for axis in (0, 1)])
    seen = int(np.isfinite(along).all(axis=-1).sum())
    for length_mm in _LENGTHS_MM:
        ends = _ends_in_picture(calibration, middle, along, length_mm)
        fits = np.isfinite(ends).all(axis=(-1, -2))
        if seen and fits.sum() >= _ENOUGH * seen:
            std = np.full(fits.shape, np.nan)
            found = lengths(calibration, ends[fits], laser=plane.name)
            std[fits] = [one.std for one in found]
            depths = _depth_range(calibration, laser)
            return LengthField(
                plane.name, length_mm, u, v, middle[..., 2], depths, std, tuple(found)
            )
    return None


def _depth_range(calibration: Calibration, laser: int) -> tuple[float, float]:
    depths = in_sheet(calibration, laser)[:, 2]
    return (float(depths.min()), float(depths.max())) if len(depths) else (0.0, np.inf)


def _tangents(calibration: Calibration, plane: LightPlane, centres: Array, axis: int) -> Array:
    """Unit directions ``(R, C, 3)`` in the sheet that appear along u (axis 0) or v (axis 1)."""
    step = np.zeros(2)
    step[axis] = 0.5
    before = triangulate(calibration, (centres - step).reshape(-1, 2), plane.name)
    after = triangulate(calibration, (centres + step).reshape(-1, 2), plane.name)
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
    """A length field in a few texts: the laser, mm, and the depths they hold for."""

    laser: str
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


def summary(field: LengthField) -> FieldSummary:
    """What the headline says, for the depths at which targets stood."""
    std = field.representative_std_mm
    nearest, farthest = field.depth_range_mm
    return FieldSummary(
        laser=field.laser,
        length=f"{field.length_mm:g}",
        best=two_digits(float(std.min())),
        median=two_digits(float(np.median(std))),
        worst=two_digits(float(std.max())),
        depths=f"Z {nearest:.0f} to {farthest:.0f} mm" if np.isfinite(farthest) else "",
    )


def field_tables(field: LengthField) -> tuple[FieldTable, ...]:
    """One table for each direction."""
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
