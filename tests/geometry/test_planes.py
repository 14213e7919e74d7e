"""Laws of planes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.geometry.directions import normalised, tangent_basis
from sheetoflight.geometry.planes import fitted_plane, ray_depths


@given(st.integers(0, 10_000), st.floats(1.0, 1e4))
def test_points_of_a_plane_give_it_back(seed: int, distance: float) -> None:
    rng = np.random.default_rng(seed)
    normal = normalised(rng.normal(size=3))
    e1, e2 = tangent_basis(normal)
    flat = rng.uniform(-500, 500, (20, 2))
    points = distance * normal + flat[:, :1] * e1 + flat[:, 1:] * e2
    found, found_distance = fitted_plane(points)
    assert np.allclose(found, normal, atol=1e-9)
    assert np.isclose(found_distance, distance, rtol=1e-9, atol=1e-7)


def test_a_ray_meets_the_plane_only_in_front() -> None:
    normal = np.array([0.0, 0.0, 1.0])
    rays = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [3.0, 0.0, 2.0]])
    depths = ray_depths(rays, normal, 10.0)
    assert np.array_equal(depths, [10.0, np.nan, np.nan, 5.0], equal_nan=True)
