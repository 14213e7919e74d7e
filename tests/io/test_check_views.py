"""Views that no picture can have given are refused; wrong detections go on to the calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.check_views import check_views
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

SIZE = (1392, 1040)
RIG = Rig(CollinearTarget(), SIZE, lasers=("left", "right"))


def views(*points: list[tuple[float, float]]) -> TargetViews:
    return TargetViews(tuple(f"view{i}" for i in range(len(points))), np.array(points))


def check(**stages: TargetViews) -> None:
    check_views(replace(RIG, observations=replace(Observations(), **stages)))


def changed(seen: TargetViews, view: int, point: int, to: tuple[float, float]) -> TargetViews:
    uv = np.array(seen.uv)
    uv[view, point] = to
    return TargetViews(seen.names, uv)


def test_good_views_pass(two_lasers: Observations):
    check_views(replace(RIG, observations=two_lasers))


@pytest.mark.parametrize("stage", ["camera", "plane"])
def test_a_wrong_detection_reaches_the_calibration(observations: Observations, stage: str):
    """Markers changed for each other, and a marker far off the line of the others."""
    seen = getattr(observations, stage)
    check(**{stage: TargetViews(seen.names, seen.uv[:, [0, 2, 1]])})
    check(**{stage: changed(seen, 3, 1, (20.0, 1000.0))})


@pytest.mark.parametrize(
    "point", [(-0.6, 5.0), (1391.6, 5.0), (5.0, -0.6), (5.0, 1039.6), (1e300, 0.0)], ids=repr
)
def test_points_outside_the_picture_are_refused(
    observations: Observations, point: tuple[float, float]
):
    message = rf"view camera03: marker 1 at \({point[0]:.6g}, {point[1]:.6g}\) lies outside"
    with pytest.raises(InputError, match=message.replace("+", r"\+")):
        check(camera=changed(observations.camera, 3, 1, point))


@pytest.mark.parametrize(
    ("point", "name"),
    [
        (0, "marker 0"),
        (2, "marker 2"),
        (3, "the spot of laser left"),
        (4, "the spot of laser right"),
    ],
    ids=["first", "last", "left", "right"],
)
def test_markers_and_spots_of_a_crossing_view_are_checked_alike(
    two_lasers: Observations, point: int, name: str
):
    message = rf"stage crossing, view one: {name}.* at \(5, 1040\) lies outside the picture"
    with pytest.raises(InputError, match=message):
        check(crossing=changed(two_lasers.crossing, 2, point, (5.0, 1040.0)))


def test_the_picture_reaches_to_the_outer_edges_of_its_pixels():
    check(camera=views([(-0.5, -0.5), (695.5, 519.5), (1391.5, 1039.5)]))


def test_a_copied_view_is_refused():
    line = [(100.0, 100.0), (200.0, 200.0), (np.nan, np.nan)]
    other = [(100.0, 100.0), (200.0, 200.0), (300.0, 300.0)]
    check(plane=views(line, other))
    check(camera=views(line), plane=views(line))
    with pytest.raises(InputError, match="stage plane: view view2 repeats view view0 exactly"):
        check(plane=views(line, other, line))


def test_views_in_which_nothing_was_seen_are_no_copies():
    nothing = [(np.nan, np.nan)] * 3
    check(plane=views(nothing, nothing))
