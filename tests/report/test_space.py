"""Figures in space: what they show is where things are."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import plotly.graph_objects as go
import pytest

from sheetoflight.model.calibration import ViewResiduals
from sheetoflight.report import space
from tests.report.examples import (
    RIG,
    calibration_of_two_lasers,
    example_calibration,
    line_piece,
)

SINGLE = 1e-3  # mm: coordinates are stored with seven digits


def traces(figure: go.Figure) -> list[Any]:
    return list(cast("Any", figure).data)


def xyz(trace: Any) -> np.ndarray:
    points = np.column_stack([np.asarray(c, float) for c in (trace.x, trace.y, trace.z)])
    return points[np.isfinite(points).all(axis=1)]


def named(figure: go.Figure, start: str) -> Any:
    (trace,) = [trace for trace in traces(figure) if trace.name.startswith(start)]
    return trace


def test_markers_stand_where_they_were_estimated(calibration):
    figure = space.points_and_sheets(calibration)
    for stage in ("camera (", "plane"):
        views = [v for v in calibration.residuals.views if stage.startswith(v.stage)]
        expected = np.concatenate([v.xyz for v in views])
        assert xyz(named(figure, stage)) == pytest.approx(expected, abs=SINGLE)


def test_the_patch_lies_in_the_sheet_and_holds_the_targets_placed_in_it(calibration):
    corners = xyz(named(space.points_and_sheets(calibration), "laser"))
    plane = RIG.light_plane
    assert corners @ plane.normal == pytest.approx(plane.distance_mm, abs=SINGLE)
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    assert first @ second == pytest.approx(0.0, abs=1.0)
    assert corners[2] == pytest.approx(corners[0] + first + second, abs=SINGLE * 4)
    placed = np.concatenate([v.xyz for v in calibration.residuals.views if v.stage == "plane"])
    for side in (first, second):
        share = (placed - corners[0]) @ side / (side @ side)
        assert share.min() > 0
        assert share.max() < 1


def test_the_pyramid_starts_at_the_centre_and_ends_on_the_rays_of_the_corners(calibration):
    (trace,) = [t for t in traces(space.points_and_sheets(calibration)) if t.name == "camera"]
    points = xyz(trace)
    tips = points[np.linalg.norm(points, axis=1) > 0]
    assert len(points) - len(tips) == 4
    uv = calibration.camera.project(tips[:4])
    corners = [[0, 0], [1391, 0], [1391, 1039], [0, 1039]]
    assert uv == pytest.approx(np.array(corners, float), abs=0.01)


def test_axes_are_true_to_scale_and_hold_everything(calibration):
    figure = space.points_and_sheets(calibration)
    scene = figure.layout.scene
    axes = [scene.xaxis, scene.yaxis, scene.zaxis]
    spans = np.array([axis.range[1] - axis.range[0] for axis in axes])
    ratio = np.array([scene.aspectratio.x, scene.aspectratio.y, scene.aspectratio.z])
    assert spans / ratio == pytest.approx(spans.max())
    points = np.concatenate([xyz(trace) for trace in traces(figure)])
    low, high = np.array([axis.range for axis in axes]).T
    assert (points >= low).all()
    assert (points <= high).all()
    assert scene.camera.up.y == -1


def test_a_piece_is_drawn_where_it_is_triangulated(calibration):
    piece = line_piece(np.array([[700.0, 300.0], [760.0, 600.0]]))
    drawn = xyz(named(space.reconstructed(calibration, [piece], ["piece 1"]), "piece 1"))
    assert drawn == pytest.approx(calibration.triangulate(piece.uv), abs=SINGLE)


def test_a_long_piece_is_thinned_and_keeps_its_ends(calibration):
    ends = np.array([[20.0, 30.0], [1370.0, 1010.0]])
    piece = line_piece(ends)
    assert len(piece) > 1500
    drawn = xyz(named(space.reconstructed(calibration, [piece], ["piece 1"]), "piece 1"))
    assert len(drawn) == 1500
    assert drawn[[0, -1]] == pytest.approx(calibration.triangulate(piece.uv[[0, -1]]), abs=SINGLE)


@pytest.mark.parametrize(
    "views",
    [
        (),
        (ViewResiduals("plane", "a", *(np.full((3, n), np.nan) for n in (2, 2, 3))),),
        (ViewResiduals("plane", "a", np.ones((1, 2)), np.ones((1, 2)), np.full((1, 3), 900.0)),),
    ],
    ids=["no views", "nothing seen", "one marker"],
)
def test_sparse_calibrations_show_camera_and_sheet(views):
    figure = space.points_and_sheets(example_calibration(views=views))
    corners = xyz(named(figure, "laser"))
    assert corners @ RIG.light_plane.normal == pytest.approx(RIG.light_plane.distance_mm, abs=0.01)


def test_a_piece_off_the_sheet_leaves_an_empty_figure(calibration):
    """Beyond the sheet's horizon, where rays run away from it."""
    off = line_piece(np.array([[-3000.0, 500.0], [-3001.0, 510.0]]))
    figure = space.reconstructed(calibration, [off], ["piece 1"])
    assert not len(xyz(named(figure, "piece 1")))


def test_every_sheet_holds_its_own_targets_and_spots():
    calibration = calibration_of_two_lasers()
    figure = space.points_and_sheets(calibration)
    for plane in calibration.light_planes:
        corners = xyz(named(figure, f"sheet {plane.name}"))
        assert corners @ plane.normal == pytest.approx(plane.distance_mm, abs=SINGLE)
        inside = [xyz(named(figure, f"plane, {plane.name} (5 views)"))]
        inside.append(xyz(named(figure, f"crossing, spots of {plane.name} (4 views)")))
        assert [len(points) for points in inside] == [15, 4]
        points = np.concatenate(inside)
        assert points @ plane.normal == pytest.approx(plane.distance_mm, abs=SINGLE)
        for side in (corners[1] - corners[0], corners[3] - corners[0]):
            share = (points - corners[0]) @ side / (side @ side)
            assert share.min() > 0
            assert share.max() < 1


@pytest.mark.parametrize("laser", ["left", "right"])
def test_a_piece_lies_in_the_sheet_of_its_laser(laser):
    calibration = calibration_of_two_lasers()
    piece = line_piece(np.array([[640.0, 300.0], [660.0, 600.0]]))
    drawn = xyz(named(space.reconstructed(calibration, [piece], ["p"], laser), "p"))
    plane = calibration.sheet(laser)
    assert drawn @ plane.normal == pytest.approx(plane.distance_mm, abs=SINGLE)
