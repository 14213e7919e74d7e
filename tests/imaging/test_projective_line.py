"""Projective maps of a straight scale, against a pinhole camera written out."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.imaging.markers.projective_line import foretold_points, vanishing_point

angles = st.floats(-1.2, 1.2)


def seen(t: np.ndarray, tilt: float, roll: float, focal: float = 2000.0) -> np.ndarray:
    """Image points of a scale 1000 mm ahead, tilted towards the camera."""
    x, z = t * np.cos(tilt), 1000.0 + t * np.sin(tilt)
    u = focal * x / z
    return np.stack([u * np.cos(roll) + 50.0, u * np.sin(roll) - 20.0], axis=-1)


@given(angles, angles)
def test_sizes_foretell_places(tilt: float, roll: float) -> None:
    t = np.array([0.0, 90.0, 250.0, 400.0])
    uv = seen(t, tilt, roll)
    near = seen(t + 1e-3, tilt, roll)
    scales = np.linalg.norm(near - uv, axis=1) / 1e-3
    foretold = foretold_points(uv[[0, 3]], scales[[0, 3]], t[1:3] / t[3])
    assert np.abs(foretold - uv[1:3]).max() < 1e-3


@given(angles, angles)
def test_vanishing_point_is_the_limit(tilt: float, roll: float) -> None:
    t = np.array([0.0, 150.0, 400.0])
    point = vanishing_point(seen(t, tilt, roll), t)
    # The direction's own image: f cot(tilt) along the line, at infinity for a frontal scale.
    along = np.array([np.cos(roll), np.sin(roll)])
    expected = np.array([*(2000.0 * np.cos(tilt) * along + np.sin(tilt) * np.array([50.0, -20.0])),
                         np.sin(tilt)])  # fmt: skip
    point, expected = point / np.linalg.norm(point), expected / np.linalg.norm(expected)
    assert np.linalg.norm(np.cross(point, expected)) < 1e-7
