"""The sheet of light as the paper finds it: RANSAC, then a genetic search (section 4.1.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, isfinite

import numpy as np

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.estimation.genetic import GeneticOptions, genetic_minimum
from sheetoflight.estimation.ransac import consensus
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import fitted_plane

_UNCONVERGED = 0.1
"""Excess over the least squares at which the search counts as failed: then its plane is off by a
third of the standard uncertainty that is stated for it."""

_NOTHING_MM2 = 0.01
_SCALE = 1000.0  # the paper writes aX + bY + cZ + 1000 = 0


@dataclass(frozen=True)
class PaperOptions:
    """The paper's settings, and the size of the genetic search.

    Parameters
    ----------
    threshold_mm : float
        Greatest distance of an inlier from the plane; the paper's 0.94 mm.
    inlier_share : float
        Share of points that the plane is fitted to at the least; the paper's 24 of 30. Where
        fewer lie within the threshold, the nearest ones are taken.
    draws : int
        Random draws; the paper's 100 000. Pairs of target positions are drawn rather than
        triples of points, of which many are collinear, and all pairs are tried where they
        are fewer.
    bounds : float
        Half width of the search around the least-squares plane, relative to the length of
        (a, b, c). The paper's own bounds exclude its own result.
    genetic : GeneticOptions
        The paper's is ``GeneticOptions(population=3000, generations=300)``.
    """

    threshold_mm: float = 0.94
    inlier_share: float = 0.8
    draws: int = 100_000
    bounds: float = 0.05
    genetic: GeneticOptions = field(default_factory=GeneticOptions)

    def __post_init__(self) -> None:
        if not (isfinite(self.threshold_mm) and self.threshold_mm > 0):
            raise InputError(
                f"the threshold is {self.threshold_mm} mm", "give a distance above zero"
            )
        if not 0 < self.inlier_share <= 1 or self.draws < 1 or not 0 < self.bounds < 1:
            raise InputError(
                f"inlier_share {self.inlier_share}, draws {self.draws}, bounds {self.bounds}",
                "give shares between 0 and 1, and at least one draw",
            )


@dataclass(frozen=True)
class PaperPlane:
    """A plane and what it rests on.

    Parameters
    ----------
    normal : (3,) array, distance : float
        ``normal · X = distance``, mm.
    used : (N, 3) mask
        The points it was fitted to.
    agreeing : int
        How many points lie within the threshold of the best sample's plane.
    """

    normal: Array
    distance: float
    used: np.ndarray
    agreeing: int


def paper_plane(points: Array, options: PaperOptions) -> PaperPlane:
    """Plane through triangulated markers.

    Parameters
    ----------
    points : (N, 3, 3) array
        A, P, B of N target positions in mm.
    options : PaperOptions

    Raises
    ------
    UntrustworthyError
        If fewer than two positions are given, or the genetic search did not converge.
    """
    if len(points) < 2:
        raise UntrustworthyError(
            "plane",
            f"{len(points)} position of the target in the sheet, at least 2 are needed",
            "lay the target into the sheet of light in further, differently turned positions",
        )
    flat = points.reshape(-1, 3)

    def distances(pair: np.ndarray) -> Array:
        normal, distance = fitted_plane(points[pair].reshape(-1, 3))
        return flat @ normal - distance

    rng = np.random.default_rng(options.genetic.seed)
    found = consensus(len(points), 2, distances, options.threshold_mm, options.draws, rng)
    used = found.inliers
    least = ceil(options.inlier_share * len(flat))
    if used.sum() < least:
        used = np.zeros(len(flat), dtype=bool)
        used[np.argsort(found.distances)[:least]] = True
    normal, distance = _genetic_plane(flat[used], options)
    return PaperPlane(normal, distance, used.reshape(points.shape[:2]), int(found.inliers.sum()))


def _genetic_plane(points: Array, options: PaperOptions) -> tuple[Array, float]:
    start_normal, start_distance = fitted_plane(points)
    start = -_SCALE / start_distance * start_normal
    reach = options.bounds * float(np.linalg.norm(start))

    def squared_distances(coefficients: Array) -> Array:
        heights = coefficients @ points.T + _SCALE
        return np.sum(heights**2, axis=1) / np.sum(coefficients**2, axis=1)

    best = genetic_minimum(squared_distances, start - reach, start + reach, options.genetic)
    least, found = squared_distances(np.stack([start, best]))
    if found > (1.0 + _UNCONVERGED) * least + _NOTHING_MM2:
        raise UntrustworthyError(
            "plane",
            f"the genetic search ended at {found:.3g} mm², the least squares are {least:.3g} mm²",
            "give it more individuals or generations (--population, --generations)",
        )
    length = float(np.linalg.norm(best))
    return -best / length, _SCALE / length
