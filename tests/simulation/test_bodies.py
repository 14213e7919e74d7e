"""Bodies have the shape that is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.simulation.bodies import folded_body


@pytest.mark.parametrize("opening", [60.0, 130.0])
def test_a_folded_body_opens_towards_the_viewer(opening):
    """Between the two boards' directions away from the edge lies the opening, and both come
    forward; the grid on each has its pitch."""
    body = folded_body(opening, (3, 4), 20.0)
    right, left = body.points.reshape(2, 4, 3, 3)
    a, b = right[0, -1] - right[0, 0], left[0, -1] - left[0, 0]
    assert np.linalg.norm(a) == pytest.approx(40.0)
    assert a[2] < 0
    assert b[2] < 0
    assert np.degrees(np.arccos(a @ b / 1600.0)) == pytest.approx(opening)
    np.testing.assert_allclose(right[-1, 0] - right[0, 0], (0.0, 60.0, 0.0))
    assert len(body.faces) == 2
