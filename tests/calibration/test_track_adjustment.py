"""The adjustment of tracks: its derivatives are those of its residuals."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.calibration.self_calibration import free_parameters
from sheetoflight.calibration.track_adjustment import TrackAdjustment, TrackState
from sheetoflight.geometry.directions import normalised
from sheetoflight.geometry.rotations import rotation
from tests.calibration.tracks import BARREL, TWO_AXES, carried, moving, scene, turning

STEP = 1e-6


def problem(turns_only: bool) -> tuple[TrackAdjustment, TrackState]:
    rng = np.random.default_rng(0)
    tie = free_parameters("square", "brown")
    if turns_only:
        uv = turning(BARREL, TWO_AXES[:3], 30, rng)
        rotations, translations = rotation(np.array(TWO_AXES[:3])), np.zeros((3, 3))
        places = normalised(np.nansum(normalised(BARREL.unproject(uv)) @ rotations, axis=0))
    else:
        rotations, translations = carried(3, rng)
        places = scene(30, rng)
        unit = np.linalg.norm(translations[1])
        uv = moving(BARREL, rotations, translations, places)
        translations, places = translations / unit, places / unit
    useful = np.isfinite(uv[..., 0]).sum(axis=0) >= 2
    uv[:, useful] += 0.3 * rng.normal(size=uv[:, useful].shape)
    state = TrackState(BARREL, rotations, translations, places[useful])
    return TrackAdjustment(uv[:, useful], tie, turns_only), state


@pytest.mark.parametrize("turns_only", [True, False])
def test_derivatives_are_those_of_the_residuals(turns_only: bool) -> None:
    tracks, state = problem(turns_only)
    block = tracks.blocks(state)[0]
    count, own = len(block.residuals), block.by_local.shape[2]
    assert tracks.shared_size == (8 + 6 if turns_only else 8 + 11)

    def slope(shared: np.ndarray, local: np.ndarray) -> np.ndarray:
        ends = [
            tracks.blocks(tracks.moved(state, sign * shared, [sign * local]))[0].residuals
            for sign in (1.0, -1.0)
        ]
        return (ends[0] - ends[1]) / (2.0 * STEP)

    still, nowhere = np.zeros(tracks.shared_size), np.zeros((count, own))
    for column in range(tracks.shared_size):
        shared = still.copy()
        shared[column] = STEP
        expected = slope(shared, nowhere)
        assert np.allclose(block.by_shared[..., column], expected, rtol=1e-5, atol=1e-3)
    for column in range(own):
        local = nowhere.copy()
        local[:, column] = STEP
        expected = slope(still, local)
        assert np.allclose(block.by_local[..., column], expected, rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("turns_only", [True, False])
def test_hidden_points_say_nothing(turns_only: bool) -> None:
    tracks, state = problem(turns_only)
    block = tracks.blocks(state)[0]
    hidden = np.repeat(~tracks.seen, 2, axis=1)
    assert hidden.any()
    assert not block.residuals[hidden].any()
    assert not block.by_shared[hidden].any()
    own = 2 if turns_only else 3
    count = 2 * int(tracks.seen.sum()) - own * len(tracks.seen) - tracks.shared_size
    assert tracks.degrees_of_freedom == count


def test_a_step_to_no_camera_is_not_taken() -> None:
    tracks, state = problem(turns_only=True)
    step = np.zeros(tracks.shared_size)
    step[0] = -1e5
    assert tracks.moved(state, step, [np.zeros((len(state.places), 2))]) is state
