"""What a search for the target gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class TargetSighting:
    """The target as seen in one picture.

    Parameters
    ----------
    uv : (M, 2) array
        Image point of each marker in px; (0, 0) is the centre of the top-left pixel.
    std : (M,) array
        Standard uncertainty of each image coordinate in px, predicted from the grey values'
        noise and the fit's information matrix; for discs also the bias of their ellipses
        across the target, which a single picture without K cannot tell.
    ordered : bool
        Whether the picture itself shows which end is marker 0. Where it does not (discs at
        symmetric distances), the left end comes first, or the upper one of two in a column.
    score : float
        Share of the grey values' variance that the markers' fitted formula explains, of the
        worst marker; 1 is perfect.
    diameter : (M,) array
        Geometric mean of each marker's apparent axes, px.
    """

    uv: Array
    std: Array
    ordered: bool
    score: float
    diameter: Array

    def __post_init__(self) -> None:
        if self.uv.ndim != 2 or self.uv.shape[1] != 2:
            raise InputError(
                f"a sighting's uv has shape {self.uv.shape}", "give one image point a marker (M, 2)"
            )
        for array in (self.uv, self.std, self.diameter):
            array.setflags(write=False)

    def reversed(self) -> TargetSighting:
        """The same sighting read from the other end."""
        return TargetSighting(
            self.uv[::-1].copy(), self.std[::-1].copy(), self.ordered, self.score,
            self.diameter[::-1].copy(),
        )  # fmt: skip


@dataclass(frozen=True)
class TargetSearch:
    """The outcome of a search.

    Parameters
    ----------
    sighting : TargetSighting or None
        None where the picture does not show exactly one whole target.
    reason : str
        What was found, for a person to read; says why where there is no sighting.
    """

    sighting: TargetSighting | None
    reason: str


def listed(points: np.ndarray) -> str:
    """Image points ``(N, 2)`` in words: ``(12, 34), (56, 78)``."""
    return ", ".join(f"({u:.0f}, {v:.0f})" for u, v in points)
