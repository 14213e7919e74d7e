"""What is painted on a surface, and the surface coordinates it is painted in.

Every shape gives the share of a sample's square footprint it covers, exact for one straight
edge: a sum over samples is the covered area itself, and no edge is rounded to the sampling
grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sheetoflight.geometry.directions import Array

_FLATTEST = 1e-9


@dataclass(frozen=True)
class Chart:
    """Surface coordinates of a block of samples.

    Parameters
    ----------
    a, b : arrays
        Coordinates along the surface's two axes from its centre, mm.
    a_per_px, b_per_px : pairs of arrays or floats
        Their change per pixel along u and v, mm/px.
    footprint_px : float
        Side of the square over which a sample averages, px.
    """

    a: Array
    b: Array
    a_per_px: tuple[Array, Array]
    b_per_px: tuple[Array, Array]
    footprint_px: float

    def only(self, samples: np.ndarray) -> Chart:
        """The samples of a mask."""
        a_by_u, a_by_v, b_by_u, b_by_v = (
            np.broadcast_to(slope, samples.shape)[samples]
            for slope in (*self.a_per_px, *self.b_per_px)
        )
        return Chart(
            self.a[samples], self.b[samples], (a_by_u, a_by_v), (b_by_u, b_by_v), self.footprint_px
        )

    def coverage(self, inside: Array, by_a: float | Array, by_b: float | Array) -> Array:
        """Share of each footprint in which a quantity is positive.

        Parameters
        ----------
        inside : array
            The quantity at each sample, positive inside the shape.
        by_a, by_b : float or arrays
            Its derivatives along the surface's axes.
        """
        along_u = np.abs(by_a * self.a_per_px[0] + by_b * self.b_per_px[0])
        along_v = np.abs(by_a * self.a_per_px[1] + by_b * self.b_per_px[1])
        steep = np.maximum(along_u, along_v) * self.footprint_px
        flat = np.maximum(np.minimum(along_u, along_v) * self.footprint_px, _FLATTEST * steep)
        return _half_plane_share(inside, steep, flat)

    def band(self, along: Array, half: float, by_a: float, by_b: float) -> Array:
        """Share of each footprint with ``|along| < half``, right also for thin bands."""
        below = self.coverage(half - along, by_a, by_b)
        above = self.coverage(half + along, by_a, by_b)
        return np.clip(below + above - 1.0, 0.0, 1.0)


def _half_plane_share(inside: Array, steep: Array, flat: Array) -> Array:
    """Share of a square in which a linear quantity is positive.

    Parameters
    ----------
    inside : array
        The quantity in the middle of the square.
    steep, flat : arrays
        Its change across the square along the square's two sides, the larger one first: its
        values are spread like the sum of two boxes of these widths, a trapezoid.
    """
    away = np.abs(inside)
    corner = np.maximum((steep + flat) / 2 - away, 0.0)
    beyond = np.where(away < (steep - flat) / 2, 0.5 - away / steep, corner**2 / (2 * steep * flat))
    return np.where(inside > 0, 1.0 - beyond, beyond)


class Paint(Protocol):
    """A shape in one reflectance on a surface."""

    @property
    def a(self) -> float:
        """Its middle along the surface's first axis, mm."""
        ...

    @property
    def b(self) -> float:
        """Its middle along the second axis, mm."""
        ...

    @property
    def reflectance(self) -> float:
        """Diffuse reflectance, white paint being 1."""
        ...

    @property
    def reach(self) -> float:
        """Largest distance of a painted point from the middle, mm."""
        ...

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        ...


@dataclass(frozen=True)
class Disc:
    """A filled disc of radius `reach`."""

    a: float
    b: float
    reach: float
    reflectance: float

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        a, b = chart.a - self.a, chart.b - self.b
        radius = np.maximum(np.sqrt(a * a + b * b), 1e-9 * self.reach)
        return chart.coverage(self.reach - radius, a / radius, b / radius)


@dataclass(frozen=True)
class Quadrants:
    """A disc of radius `reach` with two of its quarters painted, edges at ±45° to the axes.

    Parameters
    ----------
    along : bool
        Whether the painted quarters lie along the first axis, or across it.
    """

    a: float
    b: float
    reach: float
    reflectance: float
    along: bool

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        a, b = chart.a - self.a, chart.b - self.b
        falling = chart.coverage(a + b, 1.0, 1.0)
        rising = chart.coverage(a - b, 1.0, -1.0)
        along = falling * rising + (1.0 - falling) * (1.0 - rising)
        disc = Disc(self.a, self.b, self.reach, self.reflectance).coverage(chart)
        return disc * (along if self.along else 1.0 - along)


@dataclass(frozen=True)
class Block:
    """A filled rectangle, turned by `turn` radians from the first axis towards the second."""

    a: float
    b: float
    half_length: float
    half_width: float
    reflectance: float
    turn: float = 0.0

    @property
    def reach(self) -> float:
        """Half of the diagonal, mm."""
        return math.hypot(self.half_length, self.half_width)

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        a, b = chart.a - self.a, chart.b - self.b
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        length = chart.band(cos * a + sin * b, self.half_length, cos, sin)
        return length * chart.band(cos * b - sin * a, self.half_width, -sin, cos)


@dataclass(frozen=True)
class Checker:
    """An oblong chequered patch with every other field painted, the first one among them.

    Parameters
    ----------
    pitch : (float, float)
        Size of a field along the surface's axes, mm.
    fields : (int, int)
        Number of fields along the axes.
    """

    a: float
    b: float
    pitch: tuple[float, float]
    fields: tuple[int, int]
    reflectance: float

    @property
    def reach(self) -> float:
        """Half of the diagonal, mm."""
        return math.hypot(*self._half)

    @property
    def _half(self) -> tuple[float, float]:
        return self.pitch[0] * self.fields[0] / 2, self.pitch[1] * self.fields[1] / 2

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        a, b = chart.a - self.a, chart.b - self.b
        half_a, half_b = self._half
        columns = chart.coverage(self._wave(a + half_a, 0), 1.0, 0.0)
        rows = chart.coverage(self._wave(b + half_b, 1), 0.0, 1.0)
        same = columns * rows + (1.0 - columns) * (1.0 - rows)
        return same * chart.band(a, half_a, 1.0, 0.0) * chart.band(b, half_b, 0.0, 1.0)

    def _wave(self, along: Array, axis: int) -> Array:
        """Distance to the nearest inner edge, positive in the fields 0, 2, 4 …, mm."""
        pitch, fields = self.pitch[axis], self.fields[axis]
        inner = np.clip(along, pitch / 2, (fields - 0.5) * pitch)
        phase = np.mod(inner + pitch / 2, 2 * pitch)
        return pitch / 2 - np.abs(phase - pitch)


@dataclass(frozen=True)
class Cells:
    """A square patch of square cells, some of them painted, such as a coded marker.

    Parameters
    ----------
    side : float
        Of the whole patch, mm.
    painted : tuple of tuples of bool
        Row by row along the second axis; in each, the cells along the first.
    """

    a: float
    b: float
    side: float
    painted: tuple[tuple[bool, ...], ...]
    reflectance: float

    @property
    def reach(self) -> float:
        """Half of the diagonal, mm."""
        return self.side / math.sqrt(2.0)

    def coverage(self, chart: Chart) -> Array:
        """Painted share of each sample's footprint."""
        near = np.maximum(np.abs(chart.a - self.a), np.abs(chart.b - self.b)) < self.reach
        covered = np.zeros(near.shape)
        covered[near] = self._covered(chart.only(near))  # many patches meet in a block of samples
        return covered

    def _covered(self, chart: Chart) -> Array:
        columns = self._shares(chart, chart.a - self.a, 1.0, 0.0)
        rows = self._shares(chart, chart.b - self.b, 0.0, 1.0)
        inked = np.array(self.painted, dtype=float) @ columns
        return np.sum(rows * inked, axis=0)

    def _shares(self, chart: Chart, along: Array, by_a: float, by_b: float) -> Array:
        """Share ``(cells, n)`` of each of n footprints in every column, or row, of cells."""
        count = len(self.painted)
        edges = self.side * (np.arange(count + 1) / count - 0.5)
        return -np.diff([chart.coverage(along - edge, by_a, by_b) for edge in edges], axis=0)
