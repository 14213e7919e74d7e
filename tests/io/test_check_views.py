"""Views that cannot be pictures of a straight target are refused, and no others."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.check_views import NOISE_FLOOR_PX, OFF_LINE_LIMIT, check_target_views
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig

SIZE = (1392, 1040)


def views(*points: list[tuple[float, float]]) -> TargetViews:
    return TargetViews(tuple(f"view{i}" for i in range(len(points))), np.array(points))


def changed(
    observations: Observations, view: int, marker: int, to: tuple[float, float]
) -> TargetViews:
    uv = np.array(observations.camera.uv)
    uv[view, marker] = to
    return TargetViews(observations.camera.names, uv)


def test_good_views_pass(observations: Observations):
    check_target_views(observations.camera, "camera", SIZE)
    check_target_views(observations.plane, "plane", SIZE)


def test_the_noise_of_a_poor_detector_passes():
    """At 1 px, one of these 400 views is out of line or order with odds below 1 in 10 000."""
    rig = observed_rig(paper_rig(), 200, 200, 1.0, np.random.default_rng(11))
    check_target_views(rig.camera, "camera", (SIZE[0] + 20, SIZE[1] + 20))
    check_target_views(rig.plane, "plane", (SIZE[0] + 20, SIZE[1] + 20))


def test_a_target_seen_end_on_is_not_judged_by_its_noise():
    check_target_views(views([(100, 100), (103, 101), (101, 104)]), "camera", SIZE)


def test_two_markers_changed_for_each_other_are_found_in_every_view():
    rig = observed_rig(paper_rig(), 50, 0, 0.1, np.random.default_rng(12))
    swapped = TargetViews(rig.camera.names, rig.camera.uv[:, [0, 2, 1]])
    step = np.linalg.norm(np.diff(rig.camera.uv, axis=1), axis=-1).min(axis=1)
    for index in np.flatnonzero(step > NOISE_FLOOR_PX + 1):
        name = rig.camera.names[index]
        message = rf"stage camera, view {name}: marker 2 lies .* px before marker 1 along the line"
        with pytest.raises(InputError, match=message):
            check_target_views(swapped.take(np.array([index])), "camera", SIZE)


def test_a_target_numbered_from_its_other_end_is_in_order(observations: Observations):
    reverse = TargetViews(observations.plane.names, observations.plane.uv[:, ::-1])
    check_target_views(reverse, "plane", SIZE)


def test_order_is_asked_of_the_markers_that_were_seen():
    nan = (np.nan, np.nan)
    in_order = views([(0, 0), nan, (200, 0), (300, 0)])
    check_target_views(in_order, "camera", SIZE)
    with pytest.raises(InputError, match=r"view0: marker 3 lies 100.0 px before marker 2"):
        check_target_views(views([(0, 0), nan, (300, 0), (200, 0)]), "camera", SIZE)
    check_target_views(views([(300, 0), nan, nan, (0, 0)]), "camera", SIZE)


@pytest.mark.parametrize("marker", [0, 1, 2, 3])
def test_the_marker_off_the_line_of_four_is_named(marker: int):
    points = np.array([(100.0, 100), (200, 200), (300, 300), (400, 400)])
    points[marker] += (60.0, -60.0)
    off = 60 * np.sqrt(2)
    with pytest.raises(InputError, match=rf"marker {marker} lies {off:.1f} px off the line"):
        check_target_views(TargetViews(("a",), points[None]), "camera", SIZE)


@pytest.mark.parametrize("u", [11.0, 60.0, 150.0, 223.0, 290.0])
def test_of_three_markers_the_one_nearest_to_the_others_line_is_named(u: float):
    turned = np.array([[0.6, 0.8], [-0.8, 0.6]])
    points = np.array([(0, 0), (u, 40), (300, 0)]) @ turned.T + (100, 400)
    with pytest.raises(InputError, match=r"marker 1 lies 40.0 px off .* \(limit 30.0\) – check"):
        check_target_views(TargetViews(("a",), points[None]), "camera", SIZE)
    check_target_views(views([(0, 0), (150, 29), (300, 0)]), "camera", SIZE)


def test_a_strong_lens_stays_within_the_limit():
    """A target along the edge of the picture of a 70° lens, k1 = −0.3."""
    camera = Camera(SIZE, 1000.0, 1000.0, 695.5, 519.5, distortion=(-0.3, 0, 0, 0, 0))
    target = np.stack([np.linspace(-0.7, 0.7, 3), np.full(3, 0.52), np.ones(3)], axis=-1)
    uv = camera.project(target)
    bend = abs(uv[1, 1] - uv[0, 1]) / np.linalg.norm(uv[2] - uv[0])
    assert 0.06 < bend < 0.08 < OFF_LINE_LIMIT
    check_target_views(TargetViews(("a",), uv[None]), "camera", SIZE)


@pytest.mark.parametrize(
    "point", [(-0.6, 5.0), (1391.6, 5.0), (5.0, -0.6), (5.0, 1039.6), (1e300, 0.0)], ids=repr
)
def test_points_outside_the_picture_are_refused(
    observations: Observations, point: tuple[float, float]
):
    message = rf"view camera03: marker 1 at \({point[0]:.6g}, {point[1]:.6g}\) lies outside"
    with pytest.raises(InputError, match=message.replace("+", r"\+")):
        check_target_views(changed(observations, 3, 1, point), "camera", SIZE)


def test_the_picture_reaches_to_the_outer_edges_of_its_pixels():
    check_target_views(views([(-0.5, -0.5), (695.5, 519.5), (1391.5, 1039.5)]), "camera", SIZE)


def test_a_copied_view_is_refused():
    line = [(100.0, 100.0), (200.0, 200.0), (np.nan, np.nan)]
    other = [(100.0, 100.0), (200.0, 200.0), (300.0, 300.0)]
    check_target_views(views(line, other), "plane", SIZE)
    with pytest.raises(InputError, match="stage plane: view view2 repeats view view0 exactly"):
        check_target_views(views(line, other, line), "plane", SIZE)


def test_views_in_which_nothing_was_seen_are_no_copies():
    nothing = [(np.nan, np.nan)] * 3
    check_target_views(views(nothing, nothing), "plane", SIZE)
