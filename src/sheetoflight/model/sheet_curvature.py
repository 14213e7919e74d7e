"""How a sheet of light bends away from its plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, tangent_basis

_SHAPES = {"centre": (3,), "axes": (3, 2), "per_mm": (3,)}

AXES_TOLERANCE = 1e-6
"""How far two axes may be from orthonormal, and from the plane: more than rounding, less than a
typing error."""


@dataclass(frozen=True, eq=False)
class SheetCurvature:
    """The bend of a sheet of light, to second order.

    A cheap line lens spreads the light to a flat cone, not to a plane. Near the middle of what
    was seen that is, with ``x = a₁ · (X − centre)`` and ``y = a₂ · (X − centre)``::

        n · X = d + ½ (kxx x² + 2 kxy x y + kyy y²)

    The normal n and the distance d are the plane's (`LightPlane`), from which the sheet bends
    away. Centre and axes are chosen, not measured: they have no uncertainty.

    Parameters
    ----------
    centre : (3,) array
        A point near the middle of what was seen, mm, camera frame.
    axes : (3, 2) array
        Two orthonormal directions in the plane, a column each.
    per_mm : (3,) array
        ``(kxx, kxy, kyy)`` in 1/mm.

    Raises
    ------
    InputError
        If a shape is wrong, a number not finite, or the axes are not orthonormal.

    Examples
    --------
    >>> axes = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
    >>> bend = SheetCurvature(np.zeros(3), np.array(axes), np.array([2e-5, 0.0, 0.0]))
    >>> round(float(bend.heights(np.array([100.0, 0.0, 0.0]))), 6)
    0.1
    """

    centre: Array
    axes: Array
    per_mm: Array

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != shape or not np.isfinite(values).all():
                raise InputError(
                    f"a sheet's curvature has the {name} {values.tolist()}",
                    f"give finite numbers of shape {shape}",
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        off = np.abs(self.axes.T @ self.axes - np.eye(2)).max()
        if off > AXES_TOLERANCE:
            raise InputError(
                f"the axes of a sheet's curvature are {off:.3g} from orthonormal",
                "give two directions of length one at right angles",
            )

    @property
    def matrix(self) -> Array:
        """``K = [[kxx, kxy], [kxy, kyy]]``, 1/mm."""
        xx, xy, yy = self.per_mm
        return np.array([[xx, xy], [xy, yy]])

    def places(self, points: Array) -> Array:
        """``(x, y)`` of points ``(..., 3)``, mm from the centre along the axes."""
        return (points - self.centre) @ self.axes

    def heights(self, points: Array) -> Array:
        """``½ vᵀ K v`` ``(...)``, v the place: how far the sheet is from its plane there, mm."""
        place = self.places(points)
        return 0.5 * np.sum(place @ self.matrix * place, axis=-1)

    def slopes(self, points: Array) -> Array:
        """Derivatives ``(..., 3)`` of `heights` by the point: ``A K v``."""
        return self.places(points) @ self.matrix @ self.axes.T

    def heights_by_per_mm(self, points: Array) -> Array:
        """Derivatives ``(..., 3)`` of `heights` by kxx, kxy, kyy: ``½ x², x y, ½ y²``, mm²."""
        x, y = np.moveaxis(self.places(points), -1, 0)
        return np.stack([0.5 * x * x, x * y, 0.5 * y * y], axis=-1)

    def depths(self, origins: Array, rays: Array, normal: Array, distance: float) -> Array:
        """Factor ``s`` with which ``o + s r`` meets the sheet that bends away from a plane.

        With ``m = Aᵀ r`` and ``w = Aᵀ (o − centre)``: ``½ a s² − b s + c = 0``, where
        ``a = mᵀKm``, ``b = n · r − mᵀKw``, ``c = d − n · o + ½ wᵀKw``. Of the two roots it is the
        one that goes over into the plane's ``c/b`` as K → 0, written without a difference of
        nearly equal numbers: ``2c / (b ± √(b² − 2ac))``.

        Parameters
        ----------
        origins, rays : (..., 3) arrays
            Points of the lines, mm, and their directions.
        normal : (3,) array
        distance : float
            The plane's, mm.

        Returns
        -------
        (...) array
            NaN where the line does not meet the sheet; negative behind its origin.
        """
        slope = rays @ normal
        along, start = rays @ self.axes, self.places(origins)
        bent = along @ self.matrix
        a = np.sum(bent * along, axis=-1)
        b = slope - np.sum(bent * start, axis=-1)
        c = distance - origins @ normal + self.heights(origins)
        side = np.copysign(1.0, slope)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = side * np.sqrt(b * b - 2.0 * a * c)
            # the signs of b and the root differ only far from the plane, where b is what cancels
            depths = np.where(b * side >= 0, 2.0 * c / (b + root), (b - root) / a)
        return np.where(np.isfinite(depths), depths, np.nan)


def curvature_about(
    normal: Array, centre: Array, per_mm: Array, first_axis: Array | None = None
) -> SheetCurvature:
    """The bend of a sheet about a point, its axes made for the plane.

    Parameters
    ----------
    normal : (3,) array
        The plane's.
    centre : (3,) array
        mm.
    per_mm : (3,) array
        kxx, kxy, kyy along and across the first axis, 1/mm.
    first_axis : (3,) array, optional
        A direction whose part in the plane is the first axis; any where absent.

    Raises
    ------
    InputError
        As `SheetCurvature`, and if the first axis is along the normal.
    """
    normal = np.asarray(normal, dtype=float)
    normal = normal / np.linalg.norm(normal)
    first = tangent_basis(normal)[0] if first_axis is None else np.asarray(first_axis, dtype=float)
    first = first - (first @ normal) * normal
    with np.errstate(divide="ignore", invalid="ignore"):
        first = first / np.linalg.norm(first)
    return SheetCurvature(centre, np.stack([first, np.cross(normal, first)], axis=1), per_mm)
