"""Figures in the picture: what they show is what was observed."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.model.calibration import Residuals, ViewResiduals
from sheetoflight.report import figures
from tests.report.examples import calibration_of_two_lasers, example_calibration

GONE = np.array([[100.0, 200.0], [np.nan, np.nan], [300.0, 250.0]])


def view(stage: str = "plane", name: str = "one", uv: np.ndarray = GONE) -> ViewResiduals:
    return ViewResiduals(stage, name, uv, 0.001 * (uv - 200.0), np.column_stack([uv, uv[:, 0]]))


def traces(figure: go.Figure) -> list[Any]:
    return list(cast("Any", figure).data)


def points(trace: Any) -> np.ndarray:
    """Points of a trace without the gaps between its lines."""
    xy = np.column_stack([np.asarray(trace.x, float), np.asarray(trace.y, float)])
    return xy[np.isfinite(xy).all(axis=1)]


def test_every_seen_marker_is_drawn_at_its_image_point(calibration):
    figure = figures.image_points(calibration)
    drawn = np.concatenate([points(trace) for trace in traces(figure)])
    observed = np.concatenate([v.uv for v in calibration.residuals.views])
    assert np.array_equal(drawn, observed)
    assert [trace.name for trace in traces(figure)] == ["camera (12 views)", "plane (10 views)"]


def test_the_picture_is_drawn_with_v_down_and_square_pixels(calibration):
    layout = figures.image_points(calibration).layout
    frame = layout.shapes[0]
    assert (frame.x0, frame.y0, frame.x1, frame.y1) == (-0.5, -0.5, 1391.5, 1039.5)
    assert layout.yaxis.range[0] > layout.yaxis.range[1]
    assert layout.xaxis.range[0] < layout.xaxis.range[1]
    assert (layout.yaxis.scaleanchor, layout.yaxis.scaleratio) == ("x", 1)


def test_a_missing_marker_is_bridged_and_views_are_not_joined():
    xy, names = figures.joined([GONE, GONE + 1.0], ["a", "b"])
    assert np.isnan(xy).all(axis=1).tolist() == [False, False, True, False, False, True]
    assert names == ["a", "a", "a", "b", "b", "b"]


def test_bars_show_the_rms_of_every_view(calibration):
    bars = [trace for trace in traces(figures.residual_bars(calibration)) if trace.type == "bar"]
    heights = [y for bar in bars for y in bar.y]
    places = [x for bar in bars for x in bar.x]
    expected = [np.sqrt(np.mean(v.residuals**2)) for v in calibration.residuals.views]
    assert heights == pytest.approx(expected)
    assert places == list(range(1, 23))


def test_arrows_are_residuals_enlarged_by_the_stated_factor(calibration):
    figure = figures.residual_arrows(calibration)
    factor = float(figure.layout.xaxis.title.text.split()[-2])
    for trace, stage in zip(traces(figure)[::2], ("camera", "plane"), strict=True):
        shafts = points(trace).reshape(-1, 2, 2)
        views = [v for v in calibration.residuals.views if v.stage == stage]
        assert shafts[:, 0] == pytest.approx(np.concatenate([v.uv for v in views]))
        residuals = np.concatenate([v.residuals for v in views])
        assert shafts[:, 1] - shafts[:, 0] == pytest.approx(factor * residuals)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_the_factor_is_round_and_as_large_as_it_may_be(length, residual):
    factor = figures.round_factor(length, residual)
    leading = float(f"{factor:e}".partition("e")[0])
    assert leading in (1.0, 2.0, 5.0)
    assert factor * residual <= length * (1 + 1e-9)
    assert factor * residual > length / 2.5 * (1 - 1e-9)


def test_all_residuals_and_the_circles_lie_within_the_scatter(calibration):
    figure = figures.residual_scatter(calibration)
    drawn = np.concatenate([points(trace) for trace in traces(figure)])
    assert np.array_equal(drawn, np.concatenate([v.residuals for v in calibration.residuals.views]))
    reach = figure.layout.xaxis.range[1]
    assert np.abs(drawn).max() < reach
    radii = [shape.x1 for shape in figure.layout.shapes]
    assert radii == pytest.approx([0.1, 0.2, 0.3])
    assert max(radii) < reach


@pytest.mark.parametrize(
    "draw",
    [
        figures.image_points,
        figures.residual_bars,
        figures.residual_arrows,
        figures.residual_scatter,
    ],
)
@pytest.mark.parametrize(
    "views",
    [(view(),), (view(uv=np.full((3, 2), np.nan)),), (view("crossing"), view("new stage"))],
    ids=["one view", "nothing seen", "other stages"],
)
def test_sparse_calibrations_are_drawn(draw, views):
    figure = draw(example_calibration(views=views))
    finite = [points(trace) for trace in traces(figure)]
    assert sum(map(len, finite)) >= 0
    assert {trace.name for trace in traces(figure) if trace.name}


def test_a_perfect_fit_is_drawn():
    perfect = ViewResiduals("plane", "one", GONE, np.zeros((3, 2)), np.ones((3, 3)))
    calibration = example_calibration(residuals=Residuals(0.0, 1.0, (perfect,)))
    assert "enlarged 1 times" in figures.residual_arrows(calibration).layout.xaxis.title.text


def test_names_are_shown_letter_by_letter():
    """Plotly reads <b>, <a href> and their like in texts unless they are escaped."""
    calibration = example_calibration(views=(view(stage="<b>s</b>", name="<a href='x'>v</a>"),))
    drawn = [figures.image_points(calibration), figures.residual_bars(calibration)]
    shown = "".join(str(figure.to_json()) for figure in drawn)
    assert "\\u003cb\\u003e" not in shown
    assert "\\u003ca" not in shown
    assert "&lt;b&gt;s" in shown.replace("\\u0026", "&")


def test_spots_are_drawn_apart_from_the_markers_of_their_view():
    """A line runs along the markers, and not from the last of them back to the spot."""
    calibration = calibration_of_two_lasers()
    named = {trace.name: trace for trace in traces(figures.image_points(calibration))}
    crossing = [v for v in calibration.residuals.views if v.stage == "crossing"]
    markers = named["crossing, markers (8 views)"]
    assert np.array_equal(points(markers), np.concatenate([v.uv[:3] for v in crossing]))
    assert markers.mode == "lines+markers"
    for number, laser in enumerate(("left", "right")):
        trace = named[f"crossing, spots of {laser} (4 views)"]
        spots = np.stack([v.uv[3 + number] for v in crossing])
        assert np.array_equal(points(trace), spots[np.isfinite(spots).all(axis=1)])
        assert (trace.mode, trace.marker.symbol) == ("markers", "x")
