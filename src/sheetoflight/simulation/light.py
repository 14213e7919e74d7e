"""The sheet of light on a surface: where it falls, how bright, and what shades it."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.samples import Samples
from sheetoflight.simulation.scene import Surface

_REACH = 5.0
"""Standard deviations of the sheet's profile after which it is dark."""

_BEND = 2.0
"""How many times as far from its plane as at a block's corners a curved sheet may be within."""


def camera_view(surface: Surface) -> Array:
    """Rows ``(3, 3)`` that map a camera ray to surface coordinates; see `Samples.charted`.

    A ray r meets ``n · X = d`` at ``X = d r / (n · r)``, so that ``e · (X − c)`` is a ratio of
    two linear functions of r; the last row is ``n``.
    """
    normal, distance = surface.plane
    along = distance * surface.axes - np.outer(surface.axes @ surface.centre, normal)
    return np.vstack([along, normal])


def projector_view(lit: Surface, shading: Surface, projector: Array) -> Array | None:
    """Rows ``(3, 3)`` that map a camera ray to where the light on its way to `lit` meets
    the plane of `shading`; None where that plane passes through the projector.

    With ``X`` on `lit` as in `camera_view`, the light's path ``X − P`` is ``A r / (n · r)``,
    ``A = d I − P nᵀ``. The path meets the other plane before X where
    ``rows[2] · r > n · r``.
    """
    normal, distance = lit.plane
    other, other_distance = shading.plane
    gap = other_distance - float(other @ projector)
    if abs(gap) < 1e-9 * max(1.0, other_distance):
        return None
    path = distance * np.eye(3) - np.outer(projector, normal)
    depth = other @ path / gap
    start = shading.axes @ (projector - shading.centre)
    return np.vstack([shading.axes @ path + np.outer(start, depth), depth])


def _points(samples: Samples, surface: Surface) -> Array:
    """Points ``(n, m, 3)`` of a surface that samples show, camera frame, mm."""
    normal, distance = surface.plane
    depth = distance / samples.linear(normal)
    return np.stack([samples.x * depth, samples.y * depth, depth], axis=-1)


class SheetOfLight:
    """The light a rig's projector throws on surfaces.

    A fan of light: its profile across is a Gaussian of constant thickness, its irradiance
    falls with the distance from the projector and with the cosine of incidence. The fan may be
    curved.

    Parameters
    ----------
    rig : SimulatedRig
    sigma_mm : float
        Standard deviation of the profile across the sheet, mm.
    level : float
        Brightness of a white surface lit squarely at `reference_mm`, on the sheet's middle.
    reference_mm : float
        Distance from the projector, mm.
    """

    def __init__(
        self, rig: SimulatedRig, sigma_mm: float, level: float, reference_mm: float
    ) -> None:
        self._plane = rig.light_plane
        self._curved = None if rig.is_flat(0) else rig.surface(0)
        self._projector = np.asarray(rig.projector_mm, dtype=float)
        self._sigma = sigma_mm
        self._strength = level * reference_mm

    def reaches(self, around: Samples, surface: Surface) -> bool:
        """Whether the sheet may light the surface in a block given by its corners."""
        if self._front(surface) <= 0:
            return False
        normal, _ = surface.plane
        depth = around.linear(normal)
        if not depth.min() > 0:
            return True
        away = around.linear(self._row(surface)) / depth
        reach = _REACH * self._sigma
        if self._curved is not None:
            bend = self._curved.heights(_points(around, surface)) - away
            reach += _BEND * float(np.abs(bend).max())
        return bool(away.min() < reach and away.max() > -reach)

    def on(self, samples: Samples, surface: Surface, others: list[Surface]) -> Array:
        """Brightness the laser adds to white paint on a surface, shadows of others included."""
        normal, distance = surface.plane
        depth = samples.linear(normal)
        row = self._row(surface)
        away = samples.linear(row) / depth
        if self._curved is not None:
            away = self._curved.heights(_points(samples, surface))
        along_u, along_v = samples.middle.charted_slopes(np.vstack([row, row, normal]))[0]
        blur = (along_u**2 + along_v**2) * samples.footprint_px**2 / 12.0
        variance = self._sigma**2 + blur
        profile = np.exp(away * away * (-0.5 / variance)) * np.sqrt(self._sigma**2 / variance)
        light = self._irradiance(samples, distance / depth, surface) * profile
        for other in others:
            light *= self._unshaded(samples, depth, surface, other)
        return light

    def _row(self, surface: Surface) -> Array:
        """Row whose product with a ray is the surface's distance from the sheet × ``n · r``."""
        normal, distance = surface.plane
        return distance * self._plane.normal - self._plane.distance_mm * normal

    def _front(self, surface: Surface) -> float:
        """Height of the projector over the side of the surface that the camera sees, mm."""
        normal, distance = surface.plane
        return distance - float(normal @ self._projector)

    def _irradiance(self, samples: Samples, depth: Array, surface: Surface) -> Array:
        """``level · (R0/R) · cos``; the cosine is the projector's height over R."""
        px, py, pz = self._projector
        dx, dy, dz = depth * samples.x - px, depth * samples.y - py, depth - pz
        return self._strength * self._front(surface) / (dx * dx + dy * dy + dz * dz)

    def _unshaded(
        self, samples: Samples, depth: Array, surface: Surface, other: Surface
    ) -> Array | float:
        rows = projector_view(surface, other, self._projector)
        if rows is None:
            return 1.0
        before = samples.linear(rows[2]) > depth
        if not before.any():
            return 1.0
        chart = samples.charted(rows)
        length = chart.band(chart.a, other.half_length, 1.0, 0.0)
        shade = length * chart.band(chart.b, other.half_width, 0.0, 1.0)
        return 1.0 - np.where(before, shade, 0.0)
