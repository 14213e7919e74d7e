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


def without_duplicates(found: list[tuple[float, Candidate]], most: int) -> list[Candidate]:
    """The best candidates given with their errors, at most so many, none of them twice.

    Two are the same marker if one's centre lies well within the other's outline and their
    sizes are alike.
    """
    ranked = [candidate for _, candidate in sorted(found, key=lambda pair: pair[0])]
    centres = np.array([c.centre for c in ranked]).reshape(-1, 2)
    radii = np.array([c.radius for c in ranked])
    left = np.ones(len(ranked), bool)
    kept: list[Candidate] = []
    for i, candidate in enumerate(ranked):
        if len(kept) == most:
            break
        if left[i]:
            kept.append(candidate)
            near = np.hypot(*(centres - centres[i]).T) < 0.5 * np.maximum(radii, radii[i])
            alike = (radii < 2.0 * radii[i]) & (radii > 0.5 * radii[i])
            left &= ~(near & alike)
    return kept
