"""Faults of detection change what they say, and nothing else."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from sheetoflight.simulation import detection_faults
from sheetoflight.simulation.detection_faults import Stage
from sheetoflight.simulation.poses import recorded
from tests.simulation.test_faults import EXACT, NOISY, RIG, changed, lengths_in_sheet, seeded

STAGES = get_args(Stage)


@pytest.mark.parametrize("stage", STAGES)
def test_swapped_markers_are_reversed_in_one_view(stage):
    seen = detection_faults.swapped_markers(RIG, NOISY, seeded(), stage, 2)
    sound = recorded(RIG, NOISY, seeded()).stages()[stage].uv.copy()
    sound[2, :4] = sound[2, [3, 2, 1, 0]]
    assert np.array_equal(seen.stages()[stage].uv, sound)


@pytest.mark.parametrize("stage", STAGES)
def test_defocus_scales_the_noise_of_one_stage(stage):
    seen = detection_faults.defocus(RIG, NOISY, seeded(), stage, 4.0)
    exact = detection_faults.defocus(RIG, NOISY, seeded(), stage, 0.0)
    sound = recorded(RIG, NOISY, seeded())
    for name, views in sound.stages().items():
        factor = 4.0 if name == stage else 1.0
        true = exact.stages()[stage].uv if name == stage else 0.0
        assert np.allclose(
            seen.stages()[name].uv - true, factor * (views.uv - true), rtol=0, atol=1e-8
        )
    errors = sound.stages()[stage].uv - exact.stages()[stage].uv
    assert 0 < np.abs(errors).max() < 0.1 * 6


def test_wrong_detections_are_a_share_of_the_points_displaced_within_limits():
    seen = detection_faults.wrong_detections(RIG, NOISY, seeded(), 0.1, 5.0, 9.0)
    sound = recorded(RIG, NOISY, seeded())
    for stage, views in sound.stages().items():
        wrong = changed(seen, sound, stage)
        away = np.linalg.norm((seen.stages()[stage].uv - views.uv)[wrong], axis=-1)
        assert wrong.sum() == round(0.1 * views.seen.sum())
        assert away.min() >= 5.0
        assert away.max() <= 9.0


@pytest.mark.parametrize("kind", ["displaced", "reversed", "other stage"])
@pytest.mark.parametrize(("share", "counts"), [(0.25, [3, 2, 2]), (0.001, [1, 1, 1])])
def test_bad_views_are_wrong_in_all_markers_and_in_no_spot(kind, share, counts):
    seen = detection_faults.bad_views(RIG, NOISY, seeded(), share, kind)
    sound = recorded(RIG, NOISY, seeded())
    for stage, count in zip(STAGES, counts, strict=True):
        wrong = changed(seen, sound, stage)
        bad = wrong.any(axis=1)
        assert bad.sum() == count
        assert wrong[bad][:, :4].all()
        assert not wrong[:, 4:].any()


def test_a_view_of_the_other_stage_looks_like_one():
    """In stage camera a target in the sheet, in stage plane one at the anchor."""
    seen = detection_faults.bad_views(RIG, EXACT, seeded(), 0.3, "other stage")
    sound = recorded(RIG, EXACT, seeded())
    camera = seen.camera.uv[changed(seen, sound, "camera").any(axis=1)]
    plane = seen.plane.uv[changed(seen, sound, "plane").any(axis=1)]
    anchor = RIG.camera.project(RIG.anchor_mm)
    assert lengths_in_sheet(RIG.light_plane, camera) == pytest.approx(np.full(4, 400.0))
    assert plane[:, 0] == pytest.approx(np.tile(anchor, (3, 1)))
