"""The formula of a marker: its derivatives, and where it is symmetric."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.markers import outline
from sheetoflight.imaging.markers.candidate import Candidate

CANDIDATE = Candidate(np.zeros(2), np.array([[9.0, -12.0], [11.0, 6.0]]), 130.0, 170.0)
OFFSETS = np.random.default_rng(3).uniform(-22, 22, (300, 2))


def parameters(quadrant: bool) -> np.ndarray:
    values = outline.starting_parameters(CANDIDATE, quadrant, 1.4)
    values[outline.OUTLINE] = 0.3, -0.2
    values[7:9] = 0.4, -0.3
    if quadrant:
        values[outline.CROSSING] = -0.5, 0.4
    return values


@pytest.mark.parametrize("quadrant", [True, False], ids=["quadrant", "disc"])
def test_derivatives_are_the_differences(quadrant: bool) -> None:
    values = parameters(quadrant)
    _, jacobian, _ = outline.intensity(values, OFFSETS)
    for k in range(len(values)):
        step = np.zeros_like(values)
        step[k] = 1e-6
        above, _, _ = outline.intensity(values + step, OFFSETS)
        below, _, _ = outline.intensity(values - step, OFFSETS)
        scale = np.abs(jacobian[:, k]).max()
        assert np.abs((above - below) / 2e-6 - jacobian[:, k]).max() < 1e-5 * scale


@pytest.mark.parametrize("quadrant", [True, False], ids=["quadrant", "disc"])
def test_start_repeats_the_candidate(quadrant: bool) -> None:
    values = outline.starting_parameters(CANDIDATE, quadrant, 1.0)
    found = outline.frame_of(values)
    if quadrant:
        assert np.allclose(found, CANDIDATE.frame)
    # As ellipses the two frames are equal if they differ by a rotation of the unit circle.
    assert np.allclose(found @ found.T, CANDIDATE.frame @ CANDIDATE.frame.T)
    assert outline.contrast_of(values) == pytest.approx((130.0, 170.0))


def test_black_lies_where_the_frame_says() -> None:
    values = outline.starting_parameters(CANDIDATE, True, 0.5)
    diagonals = 0.4 * np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]]) @ CANDIDATE.frame.T
    grey, _, _ = outline.intensity(values, diagonals)
    assert np.allclose(grey, [40, 40, 170, 170], atol=1e-3)


def test_a_half_turn_changes_nothing() -> None:
    values = outline.starting_parameters(CANDIDATE, True, 1.4)
    there, _, _ = outline.intensity(values, OFFSETS)
    turned, _, _ = outline.intensity(values, -OFFSETS)
    assert np.allclose(there, turned)
