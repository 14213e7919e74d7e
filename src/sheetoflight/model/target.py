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

_LARGEST_EXPANSION = 0.05
"""No solid target survives more: a coefficient in µm/(m K) was meant."""


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
    expansion_per_K : float
        Thermal expansion of the target, relative change of length per kelvin.
    warmer_by_K : float
        Temperature of the target in the pictures, less that at which its positions were measured.
    warmer_by_std_K, expansion_std_per_K : float
        Standard uncertainties of these two.

    Raises
    ------
    InputError
        If there are fewer than three markers, or they are not in order.
    """

    markers_mm: tuple[float, ...] = (0.0, 200.0, 400.0)
    tolerance_mm: float = 0.0
    marker: MarkerKind = "quadrant"
    marker_size_mm: float = 24.0
    expansion_per_K: float = 0.0
    warmer_by_K: float = 0.0
    warmer_by_std_K: float = 0.0
    expansion_std_per_K: float = 0.0

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

        self._check_temperature()

    def _check_temperature(self) -> None:
        for name in ("expansion_per_K", "warmer_by_K", "warmer_by_std_K", "expansion_std_per_K"):
            value = getattr(self, name)
            if not math.isfinite(value) or (value < 0 and name != "warmer_by_K"):
                raise InputError(f"{name} is {value}", "give a finite number, not below zero")
        if abs(self.expansion_per_K * self.warmer_by_K) > _LARGEST_EXPANSION:
            raise InputError(
                f"the target would be {self.expansion_per_K * self.warmer_by_K:.1%} longer than "
                "it was measured",
                "give expansion_per_K as a relative change per kelvin, 11.5e-6 for steel",
            )

    @cached_property
    def positions(self) -> Array:
        """Marker positions ``(M,)`` in mm from marker 0, at the temperature of the pictures."""
        return np.array(self.markers_mm) * (1.0 + self.expansion_per_K * self.warmer_by_K)

    @property
    def length_mm(self) -> float:
        """Distance from the first marker to the last, ``l1 + l2`` in the paper, mm."""
        return self.markers_mm[-1]

    @property
    def thermal_std(self) -> float:
        """Standard uncertainty of the target's scale that its temperature leaves, as a ratio."""
        return math.hypot(
            self.expansion_per_K * self.warmer_by_std_K,
            self.expansion_std_per_K * self.warmer_by_K,
        )
