"""Rotations against SciPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sheetoflight.geometry.rotations import rotation

components = st.floats(-4.0, 4.0)


@given(components, components, components)
def test_rotation_agrees_with_scipy(x: float, y: float, z: float) -> None:
    vector = np.array([x, y, z])
    assert np.allclose(rotation(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-13)


def test_no_rotation_is_the_identity() -> None:
    assert np.array_equal(rotation(np.zeros(3)), np.eye(3))
