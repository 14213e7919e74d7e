"""Laws of unit vectors and steps on the sphere."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.geometry.directions import moved, normalised, tangent_basis

coordinate = st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-6)
vectors = st.tuples(coordinate, coordinate, coordinate).map(np.array)


@given(vectors)
def test_tangent_basis_completes_a_right_handed_orthonormal_frame(vector: np.ndarray) -> None:
    direction = normalised(vector)
    first, second = tangent_basis(direction)
    frame = np.stack([first, second, direction])
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) > 0


def test_tangent_basis_has_no_singular_direction() -> None:
    axes = np.vstack([np.eye(3), -np.eye(3)])
    first, second = tangent_basis(axes)
    assert np.allclose(np.cross(first, second), axes, atol=1e-15)


@given(vectors, st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4))
def test_a_small_step_moves_by_its_own_length(vector: np.ndarray, a: float, b: float) -> None:
    direction = normalised(vector)
    after = moved(direction, np.array([a, b]))
    assert np.isclose(np.linalg.norm(after), 1.0, atol=1e-15)
    # on the unit sphere the chord differs from the tangent step in third order
    assert np.isclose(np.linalg.norm(after - direction), np.hypot(a, b), atol=1e-11)
