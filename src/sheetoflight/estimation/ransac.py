"""Random sample consensus, exhaustive where that is cheaper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class Consensus:
    """The sample that most points agree with.

    Parameters
    ----------
    distances : (P,) array
        Absolute distances of all points from what the sample fits.
    inliers : (P,) mask
        Those within the threshold.
    """

    distances: Array
    inliers: np.ndarray


def consensus(
    population: int,
    sample_size: int,
    distances: Callable[[np.ndarray], Array],
    threshold: float,
    draws: int,
    rng: np.random.Generator,
) -> Consensus:
    """Draw samples, keep the one with the most points within the threshold.

    Fischler and Bolles, Comm. ACM 24(6), 1981. Where there are no more possible samples than
    draws, every sample is tried once and chance plays no part.

    Parameters
    ----------
    population, sample_size : int
        Samples are `sample_size` of `population` items.
    distances : callable
        Indices of a sample to the distances ``(P,)`` of all points from what it fits.
    threshold : float
        Greatest distance of an inlier.
    draws : int
        How many samples at the most.
    rng : numpy.random.Generator
    """
    best, best_rank = Consensus(np.zeros(0), np.zeros(0, dtype=bool)), (-1, 0.0)
    for sample in _samples(population, sample_size, draws, rng):
        distance = np.abs(distances(sample))
        inliers = distance <= threshold
        rank = (int(inliers.sum()), -float(np.sum(distance[inliers] ** 2)))
        if rank > best_rank:
            best, best_rank = Consensus(distance, inliers), rank
    return best


def _samples(
    population: int, size: int, draws: int, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    if comb(population, size) <= draws:
        yield from (np.array(chosen) for chosen in combinations(range(population), size))
    else:
        for _ in range(draws):
            yield rng.choice(population, size, replace=False)
