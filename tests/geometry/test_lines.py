"""Laws of straight lines through points."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.geometry.lines import fitted_line, on_common_line

seeds = st.integers(0, 10_000)


@given(seeds)
def test_points_moved_to_their_line_are_collinear_and_stay_there(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-100, 100, (4, 5, 2))
    moved = on_common_line(points)
    centred = moved - moved.mean(axis=1, keepdims=True)
    assert (np.linalg.svd(centred, compute_uv=False)[:, 1] < 1e-9).all()
    assert np.allclose(on_common_line(moved), moved, atol=1e-9)


@given(seeds)
def test_the_line_minimises_the_squared_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-100, 100, (6, 2))
    centre, direction = fitted_line(points)

    def squares(angle: float, shift: float) -> float:
        normal = np.array([-np.sin(angle), np.cos(angle)])
        return float(np.sum(((points - centre) @ normal - shift) ** 2))

    best = np.arctan2(direction[1], direction[0])
    for angle, shift in rng.uniform(-1, 1, (20, 2)):
        assert squares(best, 0.0) <= squares(best + angle, shift) + 1e-9


def test_the_direction_runs_from_the_first_to_the_last_point() -> None:
    points = np.array([[5.0, 0.0], [3.0, 0.1], [1.0, 0.0]])
    assert fitted_line(points)[1][0] < 0
    assert fitted_line(points[::-1])[1][0] > 0
