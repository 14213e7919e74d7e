"""The bias of a disc's ellipse, against the exact conic of a circle in space."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.markers.perspective import bias_left, disc_centres
from tests.imaging.drawing import homography, mapped

POSITIONS = np.array([0.0, 200.0, 400.0])
RADIUS = 12.0


def ellipses(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles and frames of the circles' images, from their conics."""
    inverse = np.linalg.inv(matrix)
    middles, frames = [], []
    for s in POSITIONS:
        circle = np.array([[1, 0, -s], [0, 1, 0], [-s, 0, s * s - RADIUS**2]])
        conic = inverse.T @ circle @ inverse
        middle = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
        level = -(conic[2, 2] + conic[:2, 2] @ middle)
        values, vectors = np.linalg.eigh(conic[:2, :2] / level)
        middles.append(middle)
        frames.append(vectors / np.sqrt(values))
    return np.array(middles), np.array(frames)


@pytest.mark.parametrize("tilt", [0.3, 0.7, -0.9])
def test_bias_along_the_target_goes(tilt: float) -> None:
    matrix = homography(2300.0, 1000.0, (500.0, 400.0), tilt, 0.0, 0.4)
    truth = mapped(matrix, np.column_stack([POSITIONS, np.zeros(3)]))
    middles, frames = ellipses(matrix)
    before = np.linalg.norm(middles - truth, axis=1)
    after = np.linalg.norm(disc_centres(middles, frames, POSITIONS) - truth, axis=1)
    assert before.min() > 0.03
    assert after.max() < 1e-3


def test_bias_across_the_target_stays() -> None:
    """A limit that the documentation states: spacing says nothing of a tilt about the axis."""
    matrix = homography(2300.0, 1000.0, (500.0, 400.0), 0.4, 0.6, 0.4)
    truth = mapped(matrix, np.column_stack([POSITIONS, np.zeros(3)]))
    middles, frames = ellipses(matrix)
    along = (truth[2] - truth[0]) / np.linalg.norm(truth[2] - truth[0])
    before = (middles - truth) @ along
    error = disc_centres(middles, frames, POSITIONS) - truth
    across = error @ [-along[1], along[0]]
    assert np.abs(error @ along).max() < 0.2 * np.abs(before).max() + 0.01
    assert np.abs(across).min() > 0.05
    assert np.abs(across).max() < 3 * bias_left(frames, 2300.0).max()
