"""The sheet's layout: sizes by the contract, and targets that cannot be printed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.errors import InputError
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.sheet_layout import sheet_layout


@given(st.floats(1.0, 60.0), st.lists(st.floats(1.1, 400.0), min_size=2, max_size=6), st.booleans())
def test_the_strip_lies_in_the_page_and_reaches_one_size_beyond_the_markers(size, steps, disc):
    positions = [0.0]
    for step in steps:
        positions.append(positions[-1] + step * size)
    kind = "disc" if disc else "quadrant"
    layout = sheet_layout(CollinearTarget(tuple(positions), marker=kind, marker_size_mm=size))
    right = layout.strip_x + layout.strip_width
    assert layout.marker_x[0] - layout.strip_x == pytest.approx(size)
    assert right - layout.marker_x[-1] == pytest.approx(size)
    assert layout.strip_height == pytest.approx(2 * size)
    assert [x - layout.marker_x[0] for x in layout.marker_x] == pytest.approx(positions)
    assert 0 < layout.strip_x < right < layout.width
    assert 0 < layout.strip_y < layout.strip_y + layout.strip_height < layout.height


@pytest.mark.parametrize(("page", "size"), [("a4", (297, 210)), ("a3", (420, 297))])
def test_a_named_page_has_its_size_in_landscape(page, size):
    layout = sheet_layout(CollinearTarget((0, 60, 150), marker_size_mm=12), page)
    assert (layout.width, layout.height) == size


@pytest.mark.parametrize(
    ("markers", "size", "page", "remedy"),
    [
        ((0, 100, 300), 20, "a4", "choose page a3 or strip, or a target of at most 241 mm"),
        ((0, 200, 400), 24, "a3", "choose page strip, or a target of at most 356 mm"),
        ((0, 90, 180), 85, "a4", "choose page a3 or strip"),
    ],
)
def test_a_target_too_large_for_the_page_is_refused_with_a_way_out(markers, size, page, remedy):
    with pytest.raises(InputError) as caught:
        sheet_layout(CollinearTarget(markers, marker_size_mm=size), page)
    assert caught.value.remedy == remedy


def test_the_longest_target_that_the_error_names_fits():
    sheet_layout(CollinearTarget((0, 100, 241), marker_size_mm=20), "a4")


def test_overlapping_markers_are_refused():
    with pytest.raises(InputError, match=r"20 mm apart.*would overlap"):
        sheet_layout(CollinearTarget((0, 20, 60), marker_size_mm=24))


@pytest.mark.parametrize("height", [24.0, 0.0, float("nan")])
def test_a_strip_without_a_white_border_is_refused(height):
    with pytest.raises(InputError, match="white border, at least 30 mm"):
        sheet_layout(CollinearTarget(), strip_height_mm=height)


def test_an_unknown_page_is_refused():
    with pytest.raises(InputError, match=r"'letter' – choose strip \| a4 \| a3"):
        sheet_layout(CollinearTarget(), "letter")  # pyright: ignore[reportArgumentType]
