"""RANSAC and the genetic search against what is known exactly."""

from __future__ import annotations

from math import comb

import numpy as np

from sheetoflight.estimation.genetic import GeneticOptions, genetic_minimum
from sheetoflight.estimation.ransac import consensus


def test_consensus_finds_the_line_that_most_points_lie_on() -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(-10, 10, 40)
    y = 2 * x + 1
    y[:12] += rng.uniform(3, 30, 12)

    def distances(sample: np.ndarray) -> np.ndarray:
        (x1, x2), (y1, y2) = x[sample], y[sample]
        slope = (y2 - y1) / (x2 - x1)
        return y - y1 - slope * (x - x1)

    for draws in (50, comb(40, 2)):  # at random, and every pair
        found = consensus(40, 2, distances, 1e-6, draws, np.random.default_rng(1))
        assert np.array_equal(found.inliers, np.arange(40) >= 12)


def test_every_sample_is_tried_where_they_are_few() -> None:
    tried = []

    def distances(sample: np.ndarray) -> np.ndarray:
        tried.append(tuple(sample))
        return np.zeros(5)

    consensus(5, 2, distances, 1.0, 100, np.random.default_rng(0))
    assert len(set(tried)) == comb(5, 2)


def test_the_genetic_search_ends_at_a_known_minimum() -> None:
    centre = np.array([0.3, -1.2, 2.0])

    def objective(x: np.ndarray) -> np.ndarray:
        return np.sum((x - centre) ** 2 * [1.0, 10.0, 100.0], axis=1)

    found = genetic_minimum(objective, centre - 0.7, centre + 0.5, GeneticOptions())
    assert np.abs(found - centre).max() < 1e-3


def test_the_same_seed_gives_the_same_individual() -> None:
    options = GeneticOptions(population=20, generations=5, seed=4)
    bounds = np.full(2, -1.0), np.full(2, 1.0)

    def objective(x: np.ndarray) -> np.ndarray:
        return np.sum(x**2, axis=1)

    first, again = (genetic_minimum(objective, *bounds, options) for _ in range(2))
    assert np.array_equal(first, again)
