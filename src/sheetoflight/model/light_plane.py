"""The sheet of light as a plane in the camera frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import ray_depths

_ROUNDING = 1e-15
"""How far rounding alone takes a unit vector's length from 1."""


@dataclass(frozen=True, eq=False)
class LightPlane:
    """A sheet of light ``n · X = d`` in the camera frame.

    Parameters
    ----------
    normal : (3,) array
        Unit normal ``n``; scaled to length one here.
    distance_mm : float
        Distance ``d > 0`` from the camera's centre of projection, mm.
    name : str
        The laser's name.

    Raises
    ------
    InputError
        If the normal is zero or not finite, or the distance is not positive.

    Examples
    --------
    >>> plane = LightPlane((0.9098, 0.0872, 0.4058), 562.3337)
    >>> [round(float(c), 4) for c in plane.paper_form]
    [-1.6179, -0.1551, -0.7216]
    """

    normal: Array
    distance_mm: float
    name: str = "laser"

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

    @property
    def paper_form(self) -> Array:
        """``(a, b, c)`` of the paper's ``aX + bY + cZ + 1000 = 0`` (section 4.1.2)."""
        return self.normal * (-1000.0 / self.distance_mm)

    def intersect(self, rays: Array) -> Array:
        """Points ``(..., 3)`` in mm where rays ``(..., 3)`` from the camera meet the sheet.

        NaN where a ray runs along the sheet, or meets it behind the camera.
        """
        return rays * ray_depths(rays, self.normal, self.distance_mm)[..., None]
