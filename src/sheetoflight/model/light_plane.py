"""The sheet of light in the camera frame: a plane, or what bends away from one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import ray_depths
from sheetoflight.model.covariance import CURVATURE_PARTS, PLANE_PARTS
from sheetoflight.model.sheet_curvature import AXES_TOLERANCE, SheetCurvature

_ROUNDING = 1e-15
"""How far rounding alone takes a unit vector's length from 1."""


@dataclass(frozen=True, eq=False)
class LightPlane:
    """A sheet of light ``n · X = d`` in the camera frame.

    A curved one is ``n · X = d + ½ (kxx x² + 2 kxy x y + kyy y²)``: normal and distance are those
    of the plane that it bends away from.

    Parameters
    ----------
    normal : (3,) array
        Unit normal ``n``; scaled to length one here.
    distance_mm : float
        Distance ``d > 0`` from the camera's centre of projection, mm.
    name : str
        The laser's name.
    curvature : SheetCurvature, optional
        How the sheet bends away from the plane; flat where absent.

    Raises
    ------
    InputError
        If the normal is zero or not finite, the distance is not positive, or the curvature's axes
        do not lie in the plane.

    Examples
    --------
    >>> plane = LightPlane((0.9098, 0.0872, 0.4058), 562.3337)
    >>> [round(float(c), 4) for c in plane.paper_form]
    [-1.6179, -0.1551, -0.7216]
    """

    normal: Array
    distance_mm: float
    name: str = "laser"
    curvature: SheetCurvature | None = None

    def __post_init__(self) -> None:
        normal = np.array(self.normal, dtype=float)
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else math.nan
        if not (math.isfinite(length) and length > 0):
            raise InputError(
                f"the normal of light plane '{self.name}' is {normal.tolist()}",
                "give three finite numbers, not all zero",
            )
        if not (math.isfinite(self.distance_mm) and self.distance_mm > 0):
            raise InputError(
                f"light plane '{self.name}' has distance {self.distance_mm} mm; a sheet through "
                "the camera's centre cannot be measured with",
                "give a distance above zero and turn the normal to point away from the camera",
            )
        if abs(length - 1.0) > _ROUNDING:  # else keep every digit that was given
            normal = normal / length
        normal.setflags(write=False)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "distance_mm", float(self.distance_mm))
        if self.curvature is not None:
            self._check_axes(self.curvature)

    def _check_axes(self, curvature: SheetCurvature) -> None:
        off = float(np.abs(self.normal @ curvature.axes).max())
        if off > AXES_TOLERANCE:
            raise InputError(
                f"the axes of the curvature of light plane '{self.name}' rise by {off:.3g} out of "
                "the plane",
                "give two directions at right angles to the normal",
            )

    @property
    def parameters(self) -> dict[str, float]:
        """Normal, distance, and of a curved sheet its curvature, by their names in a covariance:
        ``laser.nx`` … ``laser.d``, ``laser.kxx`` …; mm and 1/mm."""
        parts, values = PLANE_PARTS, [*self.normal, self.distance_mm]
        if self.curvature is not None:
            parts, values = (*PLANE_PARTS, *CURVATURE_PARTS), [*values, *self.curvature.per_mm]
        return {f"{self.name}.{p}": float(v) for p, v in zip(parts, values, strict=True)}

    @property
    def paper_form(self) -> Array:
        """``(a, b, c)`` of the paper's ``aX + bY + cZ + 1000 = 0`` (section 4.1.2); of a curved
        sheet, of the plane that it bends away from."""
        return self.normal * (-1000.0 / self.distance_mm)

    def heights(self, points: Array) -> Array:
        """How far points ``(..., 3)`` lie off the sheet, along its normal, mm."""
        above = points @ self.normal - self.distance_mm
        return above if self.curvature is None else above - self.curvature.heights(points)

    def gradients(self, points: Array) -> Array:
        """Derivatives ``(..., 3)`` of `heights` by the point: along the sheet's own normal there,
        of length 1 where it does not bend."""
        if self.curvature is None:
            return np.broadcast_to(self.normal, np.shape(points))
        return self.normal - self.curvature.slopes(points)

    def normals_at(self, points: Array) -> Array:
        """The sheet's own unit normals ``(..., 3)`` at points of it."""
        gradients = self.gradients(points)
        return gradients / np.linalg.norm(gradients, axis=-1, keepdims=True)

    def intersect(self, rays: Array) -> Array:
        """Points ``(..., 3)`` in mm where rays ``(..., 3)`` from the camera meet the sheet.

        NaN where a ray runs along the sheet, misses it, or meets it behind the camera.
        """
        if self.curvature is None:
            return rays * ray_depths(rays, self.normal, self.distance_mm)[..., None]
        depths = self.along(np.zeros(3), rays)
        return rays * np.where(depths > 0, depths, np.nan)[..., None]

    def along(self, origins: Array, directions: Array) -> Array:
        """Factor ``s`` ``(...)`` with which lines ``o + s r`` meet the sheet; NaN where they miss.

        Parameters
        ----------
        origins, directions : (..., 3) arrays
            mm, and any unit; s is negative behind the origin.
        """
        if self.curvature is not None:
            return self.curvature.depths(origins, directions, self.normal, self.distance_mm)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = (self.distance_mm - origins @ self.normal) / (directions @ self.normal)
        return np.where(np.isfinite(factor), factor, np.nan)
