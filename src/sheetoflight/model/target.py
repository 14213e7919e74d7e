"""The collinear target: a rod with markers at known positions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array

MarkerKind = Literal["quadrant", "disc"]


@dataclass(frozen=True)
class CollinearTarget:
    """Three or more markers on a straight line.

    Parameters
    ----------
    markers_mm : tuple of float
        Position of each marker along the target from marker 0, in mm; the first is 0 and
        they increase. In the paper's letters A = 0, P = 1, B = 2, ``l1 = |AP|``, ``l2 = |PB|``.
    tolerance_mm : float
        Standard uncertainty of each position in mm; 0 where the positions are exact.
    marker : {"quadrant", "disc"}
        What is printed: a disc in four black and white quarters, or a plain disc.
    marker_size_mm : float
        Diameter of a marker in mm.

    Raises
    ------
    InputError
        If there are fewer than three markers, or they are not in order.
    """

    markers_mm: tuple[float, ...] = (0.0, 200.0, 400.0)
    tolerance_mm: float = 0.0
    marker: MarkerKind = "quadrant"
    marker_size_mm: float = 24.0

    def __post_init__(self) -> None:
        positions = tuple(float(s) for s in self.markers_mm)
        object.__setattr__(self, "markers_mm", positions)
        if len(positions) < 3:
            raise InputError(
                f"the target has {len(positions)} markers, at least 3 are needed",
                "give the position of every marker in markers_mm",
            )
        if not all(map(math.isfinite, positions)) or positions[0] != 0.0:
            raise InputError(
                f"markers_mm is {list(positions)}; it must hold numbers and begin with 0",
                "measure every position from marker 0",
            )
        if any(b <= a for a, b in pairwise(positions)):
            raise InputError(
                f"markers_mm is {list(positions)}; the positions must increase",
                "list the markers in their order along the target",
            )
        if not (math.isfinite(self.tolerance_mm) and self.tolerance_mm >= 0):
            raise InputError(
                f"tolerance_mm is {self.tolerance_mm}", "give a standard uncertainty of 0 or more"
            )
        if self.marker not in get_args(MarkerKind):
            raise InputError(f"marker is '{self.marker}'", "choose quadrant or disc")
        if not (math.isfinite(self.marker_size_mm) and self.marker_size_mm > 0):
            raise InputError(
                f"marker_size_mm is {self.marker_size_mm}", "give the diameter of a marker in mm"
            )

    @cached_property
    def positions(self) -> Array:
        """Marker positions ``(M,)`` in mm from marker 0."""
        return np.array(self.markers_mm)

    @property
    def length_mm(self) -> float:
        """Distance from the first marker to the last, ``l1 + l2`` in the paper, mm."""
        return self.markers_mm[-1]

    @property
    def relative_tolerance(self) -> float:
        """Standard uncertainty of the target's scale that `tolerance_mm` leaves, as a ratio.

        The scale is the slope of true over stated positions, fitted to all markers.
        """
        spread = self.positions - self.positions.mean()
        return self.tolerance_mm / float(np.linalg.norm(spread))
