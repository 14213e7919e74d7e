"""Which points belong together: by stage, by laser, markers and spots."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.report.point_groups import in_sheet, point_groups
from tests.report.examples import calibration_of_two_lasers, example_calibration


def test_every_seen_point_is_in_one_group():
    calibration = calibration_of_two_lasers()
    drawn = np.concatenate([uv for group in point_groups(calibration) for uv in group.uv])
    seen = np.concatenate([view.uv for view in calibration.residuals.views])
    drawn, seen = (points[np.isfinite(points).all(axis=1)] for points in (drawn, seen))
    assert sorted(map(tuple, drawn)) == sorted(map(tuple, seen))


def test_groups_are_named_by_stage_and_laser():
    titles = [group.title for group in point_groups(calibration_of_two_lasers())]
    assert titles == [
        "camera",
        "plane, left",
        "plane, right",
        "crossing, markers",
        "crossing, spots of left",
        "crossing, spots of right",
    ]
    assert [group.title for group in point_groups(example_calibration())] == ["camera", "plane"]


@pytest.mark.parametrize("laser", [0, 1])
def test_what_is_told_to_lie_in_a_sheet_lies_there(laser: int):
    """The estimate of a spot that was not seen means nothing, and is left out."""
    calibration = calibration_of_two_lasers()
    plane = calibration.light_planes[laser]
    points = in_sheet(calibration, laser)
    assert len(points) == 5 * 3 + 4
    assert points @ plane.normal == pytest.approx(plane.distance_mm)


def test_the_spots_residuals_are_their_own():
    calibration = calibration_of_two_lasers()
    crossing = [view for view in calibration.residuals.views if view.stage == "crossing"]
    spots = np.stack([view.residuals[3:] for view in crossing])
    groups = [group for group in point_groups(calibration) if group.kind == "spots"]
    for laser, group in enumerate(groups):
        own = spots[:, laser][np.isfinite(spots[:, laser]).all(axis=1)]
        assert group.rms_px == pytest.approx(np.sqrt(np.mean(own**2)))
