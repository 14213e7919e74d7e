"""Pages of calibrations that come from boards, and of cameras without a sheet of light."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any, cast

import numpy as np
import plotly.graph_objects as go
import pytest

from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.covariance import NoiseComponents
from sheetoflight.report import figures, space
from sheetoflight.report.budget import SOURCES as MEANINGS
from sheetoflight.report.length_field import length_fields
from sheetoflight.report.noise import ESTIMATED, STATED, NoiseRow, image_noise, noise_rows
from sheetoflight.report.page import build_report
from sheetoflight.report.point_groups import in_sheet, point_groups
from tests.report.board_examples import (
    BOARD,
    CAMERA_SOURCES,
    COMPONENTS,
    SOURCES,
    board_calibration,
    boards_in_space,
    camera_calibration,
)
from tests.report.examples import NO_COVARIANCE, calibration_of_two_lasers
from tests.report.test_page import Page

SINGLE = 1e-3  # mm: coordinates are stored with seven digits
CORNERS = (0, 10, 87, 77)
"""The board's corner points, around it."""


@pytest.fixture(scope="module")
def camera_page() -> Page:
    return Page(build_report(camera_calibration()))


@pytest.fixture(scope="module")
def board_page() -> Page:
    return Page(build_report(board_calibration()))


def traces(figure: go.Figure) -> list[Any]:
    return list(cast("Any", figure).data)


def parts(trace: Any, axes: str) -> list[np.ndarray]:
    """Points of a trace, cut at its gaps."""
    points = np.column_stack([np.asarray(trace[axis], float) for axis in axes])
    gaps = np.flatnonzero(~np.isfinite(points).all(axis=1))
    pieces = (piece[np.isfinite(piece).all(axis=1)] for piece in np.split(points, gaps))
    return [piece for piece in pieces if len(piece)]


def words(page: Page) -> str:
    return " ".join(page.text.split())


def noise(calibration: Calibration) -> dict[str, NoiseRow]:
    return {row.name: row for row in noise_rows(calibration)}


def test_a_camera_alone_has_a_page_without_sheets(camera_page: Page):
    text = words(camera_page)
    assert "Camera, calibrated by the joint method from 6 board views." in text
    assert "Targets and camera in space" in text
    assert "Scale comes from the board." in text
    assert not re.search(r"\bsheet\b", text)
    assert "figure-budget" not in camera_page.figures()
    drawn = camera_page.figures()["figure-space"]["data"]
    assert [trace.get("name") for trace in drawn] == ["board (6 views)", None, "camera"]


@pytest.mark.parametrize("made", [board_calibration, camera_calibration])
def test_no_number_is_missing(made: Any):
    page = Page(build_report(made()))
    assert not re.search(r"\bnan\b|\binf\b|None", page.text)
    for attributes, text in page.raw:
        if attributes.get("type") == "application/json":
            json.loads(text, parse_constant=pytest.fail)


@pytest.mark.parametrize("made", [board_calibration, camera_calibration])
def test_links_of_the_page_lead_somewhere(made: Any):
    page = Page(build_report(made()))
    ids = {value for _, name, value in page.attributes if name == "id"}
    links = {v.removeprefix("#") for _, n, v in page.attributes if n == "href" and v[0] == "#"}
    assert links <= ids


def test_a_camera_without_covariance_has_a_page():
    page = Page(build_report(camera_calibration(covariance=NO_COVARIANCE)))
    assert "No budget" in words(page)


def test_every_board_view_stands_in_the_table(board_page: Page):
    rows = {row[0]: row[1:] for row in board_page.cells if row and row[0].startswith("frame")}
    calibration = board_calibration()
    assert list(rows) == [view.view for view in calibration.residuals.views]
    for number, view in enumerate(calibration.residuals.views):
        seen, rms, largest = rows[view.view]
        assert seen == f"{88 - (number == 0)} of 88"
        lengths = np.hypot(*view.residuals.T)
        assert float(largest) == pytest.approx(np.nanmax(lengths), rel=0.05)
        assert float(rms) == pytest.approx(np.sqrt(np.nanmean(lengths**2) / 2), rel=0.05)


def test_the_stage_of_boards_is_one_row(board_page: Page):
    (row,) = [row for row in board_page.cells if row[0] == "board" and len(row) == 5]
    assert row[1:3] == ["6", str(6 * 88 - 1)]
    every = np.concatenate([v.residuals for v in board_calibration().residuals.views])
    assert float(row[3]) == pytest.approx(np.sqrt(np.nanmean(every**2)), rel=0.05)
    assert float(row[4]) == pytest.approx(np.nanmax(np.hypot(*every.T)), rel=0.05)


def test_points_that_were_not_seen_have_no_largest_residual():
    (view, *_) = board_calibration().residuals.views
    gone = replace(view, uv=np.full((88, 2), np.nan), residuals=np.full((88, 2), np.nan))
    (group,) = point_groups(board_calibration(residuals=Residuals(0.0, 1.0, (gone,))))
    assert (group.seen, np.isnan(group.largest_px)) == (0, True)
    page = Page(build_report(board_calibration(residuals=Residuals(0.0, 1.0, (gone,)))))
    assert ["frame00", "0 of 88", "–", "–"] in page.cells


def test_every_source_is_explained(board_page: Page, camera_page: Page):
    assert set(SOURCES) <= set(MEANINGS)
    for page, sources in ((board_page, SOURCES), (camera_page, CAMERA_SOURCES)):
        text = words(page)
        for source in sources:
            assert f"{source}{MEANINGS[source]}" in text
        (heading,) = [row for row in page.cells if row and row[0] == "Parameter"]
        assert heading[3:-2] == list(sources)


def test_sources_of_boards_have_colours_of_their_own(board_page: Page):
    drawn = board_page.figures()["figure-budget"]["data"]
    assert [trace["name"] for trace in drawn] == [*SOURCES, "image points"]
    colours = {trace["marker"]["color"] for trace in drawn}
    assert len(colours) == len(drawn)
    assert figures.OTHER_COLOUR not in colours


def test_noise_of_boards_has_words_and_units():
    rows = noise(board_calibration())
    assert list(rows) == [*COMPONENTS, "shape"]
    assert {name: row.unit for name, row in rows.items()} == {
        "corner": "px",
        "stripe": "px",
        "line": "mm",
        "shape": "px",
    }
    assert all(row.meaning for row in rows.values())
    for name, (size, freedom) in COMPONENTS.items():
        row = rows[name]
        assert row.origin == ESTIMATED
        assert float(row.size) == pytest.approx(size, rel=0.05)
        assert float(row.std) == pytest.approx(size / np.sqrt(2 * freedom), rel=0.05)
    assert (rows["shape"].size, rows["shape"].std) == ("–", "–")
    assert "show none" in rows["shape"].origin


def test_a_camera_from_boards_has_the_noise_of_their_points_only():
    assert list(noise(camera_calibration())) == ["corner"]


def test_a_stated_noise_is_that_of_the_boards_points():
    found = camera_calibration()
    stated = replace(found, covariance=replace(found.covariance, components=NoiseComponents()))
    assert image_noise(stated) == "corner"
    (row,) = noise_rows(stated)
    assert (row.name, row.size, row.unit, row.origin) == ("corner", "0.17", "px", STATED)
    assert "per coordinate; stated" in words(Page(build_report(stated)))


def test_the_summary_says_that_the_noise_was_estimated(camera_page: Page):
    assert "per coordinate; estimated from the residuals" in words(camera_page)


def test_rods_and_boards_together_have_the_noise_of_both():
    rods = calibration_of_two_lasers()
    views = (*rods.residuals.views, *board_calibration().residuals.views)
    both = replace(rods, residuals=Residuals(0.1, 1.0, views))
    assert image_noise(both) == "pixel"
    assert list(noise(both)) == [
        *("pixel", "placement", "marker", "corner"),
        *("target length", "temperature"),
    ]


def test_boards_are_outlines_in_the_picture():
    """A board seen whole is bounded by its corner points, and by others on its edges."""
    calibration = camera_calibration()
    outlines, points = traces(figures.image_points(calibration))
    rings = parts(outlines, "xy")
    for view, ring in zip(calibration.residuals.views, rings, strict=True):
        assert np.array_equal(ring[0], ring[-1])
        drawn = {tuple(uv) for uv in ring}
        assert {tuple(view.uv[corner]) for corner in CORNERS} <= drawn
        assert drawn <= {tuple(uv) for uv in view.uv}
    assert points.mode == "markers"
    seen = np.concatenate([view.uv for view in calibration.residuals.views])
    assert np.array_equal(np.concatenate(parts(points, "xy")), seen[np.isfinite(seen).all(axis=1)])


def test_boards_are_outlines_in_space():
    calibration = camera_calibration()
    outlines, points, _ = traces(space.points_and_sheets(calibration))
    size = np.array([10 * 12.0, 7 * 12.0])
    for view, ring in zip(calibration.residuals.views, parts(outlines, "xyz"), strict=True):
        assert ring[0] == pytest.approx(ring[-1])
        length = np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()
        assert length == pytest.approx(2 * size.sum(), abs=0.1)
        for corner in CORNERS:
            assert np.linalg.norm(ring - view.xyz[corner], axis=1).min() < SINGLE
    every = np.concatenate([view.xyz for view in calibration.residuals.views])
    assert np.concatenate(parts(points, "xyz")) == pytest.approx(every, abs=SINGLE)


def test_a_board_of_which_little_was_seen_is_drawn():
    (view, *_) = camera_calibration().residuals.views
    for count in (0, 1, 2, 3):
        uv = view.uv.copy()
        uv[count:] = np.nan
        residuals = np.where(np.isfinite(uv), view.residuals, np.nan)
        part = replace(view, uv=uv, residuals=residuals)
        calibration = camera_calibration(residuals=Residuals(0.1, 1.0, (part,)))
        drawn = np.concatenate([np.empty((0, 2)), *parts(_outlines(calibration), "xy")])
        assert {tuple(point) for point in drawn} == {tuple(point) for point in uv[:count]}
        space.points_and_sheets(calibration)


def _outlines(calibration: Calibration) -> Any:
    return traces(figures.image_points(calibration))[0]


def test_boards_show_where_the_sheet_was_used():
    """The true lines reach one pitch beyond the outermost points, along the board."""
    calibration = board_calibration()
    plane = calibration.light_plane
    ends = in_sheet(calibration, 0)
    assert ends @ plane.normal == pytest.approx(plane.distance_mm)
    line = boards_in_space(6).line
    assert len(ends) == 2 * len(np.unique(line.view))
    for pair, view in zip(ends.reshape(-1, 2, 3), np.unique(line.view), strict=True):
        own = line.points[line.view == view]
        along = line.along[line.view == view][0]
        places, found = np.sort(own @ along), np.sort(pair @ along)
        assert places[0] < found[0] < found[1] < places[-1]
        assert pair - own.mean(axis=0) == pytest.approx(
            np.outer((pair - own.mean(axis=0)) @ along, along), abs=1e-6
        )
    (field,) = length_fields(calibration)
    assert field.depth_range_mm == pytest.approx((ends[:, 2].min(), ends[:, 2].max()))


def test_a_line_beside_the_points_is_found_on_the_board_around_them():
    """The sheet passes the outermost points at a fifth of the board's width."""
    (view, *_) = board_calibration().residuals.views
    left, right = view.xyz[0] - view.xyz[10], view.xyz[77] - view.xyz[0]
    normal = left / np.linalg.norm(left)
    beside = view.xyz[0] + 0.2 * left
    sign = 1.0 if normal @ beside > 0 else -1.0
    plane = replace(
        board_calibration().light_plane,
        normal=sign * normal,
        distance_mm=float(sign * normal @ beside),
    )
    calibration = board_calibration(light_planes=(plane,), residuals=Residuals(0.1, 1.0, (view,)))
    ends = in_sheet(calibration, 0)
    assert ends @ plane.normal == pytest.approx(plane.distance_mm)
    facing = np.cross(left, right) / np.prod(np.linalg.norm([left, right], axis=1))
    assert (ends - view.xyz[0]) @ facing == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(2 * 7 * 12.0)


def test_boards_without_lines_tell_nothing_of_the_sheet():
    found = board_calibration()
    quiet = replace(found.covariance, components=NoiseComponents())
    assert not len(in_sheet(replace(found, covariance=quiet), 0))


def test_many_points_have_short_arrows():
    """Thousands of arrows stay readable: a usual one is shorter than the points are apart."""
    few, many = camera_calibration(2), camera_calibration(40)
    lengths = []
    for calibration in (few, many):
        title = figures.residual_arrows(calibration).layout.xaxis.title.text
        lengths.append(float(title.split()[-2]) * calibration.residuals.rms_px)
    width, height = many.camera.image_size
    assert lengths[1] < np.sqrt(width * height / (40 * len(BOARD.points)))
    assert lengths[1] < lengths[0] <= 0.03 * width


def test_a_page_with_thousands_of_points_stays_small():
    text = build_report(board_calibration(40))
    assert 40 * len(BOARD.points) > 3000
    assert len(text.encode()) < 8e6


def test_nothing_left_out_is_told_for_boards(board_page: Page):
    assert "No view, point or line was left out as wrong." in words(board_page)
