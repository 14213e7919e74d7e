"""The target's axis in the picture: the curve through its markers' centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.imaging.markers.sighting import TargetSighting
from sheetoflight.model.target import CollinearTarget

# What a parabola must explain beyond a straight line, as a square in standard deviations.
_CLEARLY_BENT = 9.0


@dataclass(frozen=True)
class TargetAxis:
    """Image coordinates along and across the target, and its axis in them.

    A point has coordinates ``a = along · (uv − centre)`` and ``n = normal · (uv − centre)``, px.

    Parameters
    ----------
    centre, along, normal : (2,) array
        A point of the markers' common image line, px, and unit vectors along and across.
    markers : (M,) array
        Coordinate a of each marker, px.
    half_length, half_height : (M,) array
        Half a marker's size as it appears along and across the axis, px.
    course : (P,) array
        Coefficients, constant first, of the axis ``n = p(a)``: a straight line, or a parabola
        where the markers do not lie on one, as a lens that distorts shows them.
    covariance : (P, P) array
        Of the course, from the markers' standard uncertainties.
    """

    centre: Array
    along: Array
    normal: Array
    markers: Array
    half_length: Array
    half_height: Array
    course: Array
    covariance: Array

    def coordinates(self, uv: Array) -> tuple[Array, Array]:
        """Coordinates a and n ``(...)`` of image points ``(..., 2)``."""
        return (uv - self.centre) @ self.along, (uv - self.centre) @ self.normal

    def uv(self, a: Array, n: Array) -> Array:
        """Image points ``(..., 2)`` of coordinates ``(...)``."""
        return self.centre + np.multiply.outer(a, self.along) + np.multiply.outer(n, self.normal)

    def across(self, a: float) -> float:
        """The axis' place n at a place a, px."""
        return float(a ** np.arange(len(self.course)) @ self.course)

    def across_std(self, a: float) -> float:
        """Standard uncertainty of `across`, px."""
        powers = a ** np.arange(len(self.course))
        return float(np.sqrt(powers @ self.covariance @ powers))

    def height_at(self, a: Array) -> Array:
        """Half a marker's size across the axis at places along it, px."""
        order = np.argsort(self.markers)
        return np.interp(a, self.markers[order], self.half_height[order])


def target_axis(target: CollinearTarget, sighting: TargetSighting) -> TargetAxis:
    """The axis of a target as it was sighted."""
    centre, along = fitted_line(sighting.uv)
    normal = np.array([-along[1], along[0]])
    markers, away = (sighting.uv - centre) @ along, (sighting.uv - centre) @ normal
    positions = target.positions if markers[-1] > markers[0] else -target.positions
    scale = np.gradient(markers, positions, edge_order=2)
    half_length = np.abs(scale) * target.marker_size_mm / 2
    course, covariance = _course(markers, away, sighting.std)
    # A marker's area does not depend on how it is sheared.
    half_height = (sighting.diameter / 2) ** 2 / half_length
    return TargetAxis(centre, along, normal, markers, half_length, half_height, course, covariance)


def _course(a: Array, n: Array, std: Array) -> tuple[Array, Array]:
    """The straight line through the markers, or a parabola where it fits clearly better."""
    straight, bent = (_fitted(a, n, std, degree) for degree in (1, 2))
    return bent[:2] if straight[2] - bent[2] > _CLEARLY_BENT else straight[:2]


def _fitted(a: Array, n: Array, std: Array, degree: int) -> tuple[Array, Array, float]:
    """Coefficients of a polynomial, their covariance, and the sum of squared residuals in std."""
    reach = np.abs(a).max()
    design = (a[:, None] / reach) ** np.arange(degree + 1) / std[:, None]
    covariance = np.linalg.inv(design.T @ design)
    coefficients = covariance @ design.T @ (n / std)
    left = float(np.sum((n / std - design @ coefficients) ** 2))
    unscaled = reach ** -np.arange(degree + 1.0)
    return coefficients * unscaled, covariance * np.outer(unscaled, unscaled), left
