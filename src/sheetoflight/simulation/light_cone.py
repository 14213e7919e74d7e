"""The flat cone to which a cheap line lens really spreads the light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import curvature_about


@dataclass(frozen=True, eq=False)
class LightCone:
    """A sheet of light in the shape of a cone.

    Parameters
    ----------
    apex : (3,) array
        mm, camera frame: near the line lens.
    axis : (3,) array
        Scaled to length one here.
    half_angle : float
        Between the axis and the light, rad; a quarter turn would be a plane.

    Raises
    ------
    InputError
        If the half angle is no acute one.
    """

    apex: Array
    axis: Array
    half_angle: float

    def __post_init__(self) -> None:
        if not 0.0 < self.half_angle < math.pi / 2:
            raise InputError(
                f"a cone of light has the half angle {self.half_angle} rad",
                "give one above 0 and below pi/2; a flat sheet needs no cone",
            )
        object.__setattr__(self, "apex", np.array(self.apex, dtype=float))
        object.__setattr__(self, "axis", normalised(np.array(self.axis, dtype=float)))

    def heights(self, points: Array) -> Array:
        """Distances ``(...)`` of points ``(..., 3)`` from the cone, mm; positive outside it."""
        along, radial, _ = self._cylindrical(points)
        return radial * math.cos(self.half_angle) - along * math.sin(self.half_angle)

    def gradients(self, points: Array) -> Array:
        """Unit vectors ``(..., 3)`` out of the cone."""
        _, _, outward = self._cylindrical(points)
        return outward * math.cos(self.half_angle) - self.axis * math.sin(self.half_angle)

    def _cylindrical(self, points: Array) -> tuple[Array, Array, Array]:
        """Place along the axis, distance from it, and the unit vector away from it."""
        away = points - self.apex
        along = away @ self.axis
        off = away - along[..., None] * self.axis
        radial = np.linalg.norm(off, axis=-1)
        return along, radial, off / radial[..., None]


def touching_sheet(cone: LightCone, near: Array, name: str = "laser") -> LightPlane:
    """The curved sheet that has a cone's place, normal and curvature in one point.

    A cone is straight along its generators; across one, at the distance ρ from the apex, its
    normal curvature is ``1/(ρ tan α)``, α the half angle (do Carmo, Differential Geometry of
    Curves and Surfaces, sec. 3-3).

    Parameters
    ----------
    cone : LightCone
    near : (3,) array
        The point is the cone's nearest to this one, mm.
    name : str
        The laser's name.
    """
    normal = cone.gradients(near)
    point = near - cone.heights(near) * normal
    generator = point - cone.apex
    across = 1.0 / (float(np.linalg.norm(generator)) * math.tan(cone.half_angle))
    distance = float(normal @ point)
    side = math.copysign(1.0, distance)
    # seen along the outward normal a cone falls away on either side
    bend = curvature_about(
        side * normal, point, np.array([0.0, 0.0, -side * across]), first_axis=generator
    )
    return LightPlane(side * normal, side * distance, name, bend)
