"""What may be a marker: its place, shape and contrast, before it is measured finely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class Candidate:
    """A patch that looks like a marker.

    Parameters
    ----------
    centre : (2,) array
        Image point in px.
    frame : (2, 2) array
        Maps the unit circle to the marker's outline about its centre, in px. On a quadrant
        marker the columns lie along the two edges, and black is where both coordinates
        have the same sign: ``frame @ (1, 1)`` points along a black quarter and
        ``frame @ (1, -1)`` along a white one.
    contrast : float
        Grey value of the surround less that of the ink; negative for light on dark.
    surround : float
        Grey value of the surround.
    """

    centre: Array
    frame: Array
    contrast: float
    surround: float

    @property
    def radius(self) -> float:
        """Geometric mean of the outline's semi-axes, px."""
        return float(np.sqrt(abs(np.linalg.det(self.frame))))


def without_duplicates(found: list[tuple[float, Candidate]]) -> list[Candidate]:
    """The candidates given with their errors, less those that repeat a better one.

    Two are the same marker if one's centre lies well within the other's outline and their
    sizes are alike.
    """
    kept: list[Candidate] = []
    for _, candidate in sorted(found, key=lambda pair: pair[0]):
        if not any(_same(candidate, other) for other in kept):
            kept.append(candidate)
    return kept


def _same(one: Candidate, other: Candidate) -> bool:
    near = float(np.linalg.norm(one.centre - other.centre)) < 0.5 * max(one.radius, other.radius)
    return near and 0.5 < one.radius / other.radius < 2.0
