"""The printed target, measured in the SVG, in the PDF and on the rendered page."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from sheetoflight.errors import InputError
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.target_sheet import draw_target, sheet_format, target_sheet

SVG = "{http://www.w3.org/2000/svg}"
MM_PER_PT = 25.4 / 72
TRUE_MM = 0.01

TARGETS = {
    "default": CollinearTarget(),
    "tiny": CollinearTarget((0.0, 8.0, 16.0), marker_size_mm=5.0),
    "uneven": CollinearTarget((0.0, 61.3, 97.7, 230.1), marker_size_mm=18.0),
    "disc": CollinearTarget((0.0, 50.0, 120.0), marker="disc", marker_size_mm=20.0),
}
QUADRANT = [name for name, target in TARGETS.items() if target.marker == "quadrant"]


@cache
def shapes(target: CollinearTarget) -> tuple[tuple[float, float], dict[str, np.ndarray]]:
    """Size of the page, and the points of every named shape, in mm with y down."""
    root = ET.fromstring(target_sheet(target, "svg"))
    page = tuple(float(root.attrib[side].removesuffix("pt")) for side in ("width", "height"))
    assert root.attrib["viewBox"] == f"0 0 {page[0]:.6f} {page[1]:.6f}"
    found = {}
    for group in root.iter(f"{SVG}g"):
        paths = group.findall(f"{SVG}path")
        if paths and "transform" not in group.attrib:
            numbers = re.findall(r"-?\d+\.?\d*", " ".join(path.attrib["d"] for path in paths))
            found[group.attrib["id"]] = np.array(numbers, float).reshape(-1, 2) * MM_PER_PT
    return (page[0] * MM_PER_PT, page[1] * MM_PER_PT), found


def extent(points: np.ndarray) -> np.ndarray:
    return points.max(axis=0) - points.min(axis=0)


@pytest.mark.parametrize("name", TARGETS)
def test_the_strip_is_true_to_scale(name):
    target = TARGETS[name]
    _, found = shapes(target)
    size = target.marker_size_mm
    expected = (target.length_mm + 2 * size, 2 * size)
    assert extent(found["strip"]) == pytest.approx(expected, abs=TRUE_MM)


@pytest.mark.parametrize("name", TARGETS)
def test_the_bar_is_100_mm_long(name):
    _, found = shapes(TARGETS[name])
    assert extent(found["scale-bar"])[0] == pytest.approx(100.0, abs=TRUE_MM)


@pytest.mark.parametrize("name", TARGETS)
def test_everything_lies_on_the_page_and_the_texts_outside_the_strip(name):
    page, found = shapes(TARGETS[name])
    bottom = found["strip"][:, 1].max()
    for shape, points in found.items():
        assert (points >= 0).all(), shape
        assert (points <= page).all(), shape
        if shape.startswith(("position", "scale", "description", "tick")):
            assert points[:, 1].min() > bottom, shape


@pytest.mark.parametrize("name", QUADRANT)
def test_black_quarters_lie_along_the_axis_on_marker_0_and_across_it_on_the_others(name):
    """Every drawn point of a quarter lies within 45° of its direction and within the disc."""
    target = TARGETS[name]
    _, found = shapes(target)
    size = target.marker_size_mm
    first = found["strip"].min(axis=0) + size
    for index, position in enumerate(target.markers_mm):
        centre = first + np.array([position, 0.0])
        directions = []
        for quarter in (0, 1):
            offset = found[f"marker-{index}-quarter-{quarter}"] - centre
            radius = np.linalg.norm(offset, axis=1)
            assert radius.max() == pytest.approx(size / 2, rel=0.04)  # Bézier handles lie outside
            assert radius.min() == pytest.approx(0.0, abs=TRUE_MM)
            corners = offset[np.isclose(radius, size / 2, atol=TRUE_MM)]
            mean = corners.mean(axis=0)
            assert abs(mean[1 if index == 0 else 0]) < TRUE_MM
            angles = np.abs(np.degrees(np.arctan2(*np.abs(corners).T)))
            assert np.isclose(angles, 45.0, atol=0.1).sum() == 2
            directions.append(mean)
        assert np.sum(directions, axis=0) == pytest.approx(0.0, abs=TRUE_MM)


def test_a_disc_is_round_and_in_place():
    target = TARGETS["disc"]
    _, found = shapes(target)
    first = found["strip"].min(axis=0) + 20.0
    for index, position in enumerate(target.markers_mm):
        points = found[f"marker-{index}"]
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        assert middle == pytest.approx(first + np.array([position, 0.0]), abs=TRUE_MM)
        assert extent(points) == pytest.approx(20.0, abs=TRUE_MM)


@pytest.mark.parametrize("name", ["default", "disc"])
def test_rendered_markers_are_black_where_they_should_be(name):
    """The page as pixels, read off on rings about every marker's centre, 5° from any edge."""
    target = TARGETS[name]
    page, found = shapes(target)
    figure = draw_target(target)
    figure.set_dpi(254)  # 10 px per mm
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    grey = np.asarray(canvas.buffer_rgba())[..., :3].mean(axis=-1)
    assert grey.shape == pytest.approx((10 * page[1], 10 * page[0]), abs=1)

    first = found["strip"].min(axis=0) + target.marker_size_mm
    angle = np.radians(np.arange(0.0, 360.0, 1.0))
    away = np.abs(np.abs(np.sin(2 * angle)) - 1.0) > 1 - np.cos(np.radians(10.0))
    for index, position in enumerate(target.markers_mm):
        along = np.abs(np.cos(angle)) > np.abs(np.sin(angle))
        if target.marker == "disc":
            black = np.full(angle.shape, True)
        else:
            black = along if index == 0 else ~along
        shares = {0.3: True, 0.6: True, 0.98: True, 1.012: False, 1.5: False}
        for share, inside in shares.items():
            radius = share * target.marker_size_mm / 2
            x = first[0] + position + radius * np.cos(angle[away])
            y = first[1] + radius * np.sin(angle[away])
            seen = grey[(10 * y).astype(int), (10 * x).astype(int)]
            expected = np.where(black[away] & inside, 0.0, 255.0)
            assert np.array_equal(seen, expected), (index, share)


def test_a_higher_strip_is_drawn():
    root = ET.fromstring(target_sheet(CollinearTarget(), "svg", strip_height_mm=80.0))
    plain = ET.fromstring(target_sheet(CollinearTarget(), "svg"))
    heights = [float(r.attrib["height"].removesuffix("pt")) * MM_PER_PT for r in (root, plain)]
    assert heights[0] - heights[1] == pytest.approx(80.0 - 48.0, abs=TRUE_MM)


@pytest.mark.parametrize("page", ["strip", "a4", "a3"])
def test_the_pdf_page_has_the_size_of_the_svg(page):
    target = CollinearTarget((0.0, 60.0, 150.0), marker_size_mm=12.0)
    content = target_sheet(target, "pdf", page)
    assert content.startswith(b"%PDF-")
    assert content.rstrip().endswith(b"%%EOF")
    (box,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", content)
    root = ET.fromstring(target_sheet(target, "svg", page))
    size = [float(root.attrib[side].removesuffix("pt")) for side in ("width", "height")]
    assert [float(side) for side in box] == pytest.approx(size, abs=0.01)
    if page == "a4":
        assert [float(side) * MM_PER_PT for side in box] == pytest.approx([297, 210], abs=TRUE_MM)


@pytest.mark.parametrize("file_format", ["svg", "pdf"])
def test_the_same_target_gives_the_same_bytes_whatever_the_users_settings(file_format):
    plain = target_sheet(CollinearTarget(), file_format)
    with mpl.rc_context({"savefig.bbox": "tight", "savefig.dpi": 30, "font.size": 30}):
        assert target_sheet(CollinearTarget(), file_format) == plain
        assert mpl.rcParams["savefig.bbox"] == "tight"
    assert b"Date" not in plain


@pytest.mark.parametrize(("path", "expected"), [("a.svg", "svg"), ("b/T.PDF", "pdf")])
def test_the_ending_chooses_the_format(path, expected):
    assert sheet_format(path) == expected


@pytest.mark.parametrize("path", ["target.png", "target", "svg"])
def test_other_endings_are_refused(path):
    with pytest.raises(InputError, match=f"{path}.*drawn as .svg or .pdf"):
        sheet_format(path)


def test_other_formats_are_refused():
    with pytest.raises(InputError, match="'png'"):
        target_sheet(CollinearTarget(), "png")  # pyright: ignore[reportArgumentType]


def test_drawing_leaves_pyplot_alone():
    code = (
        "import sys; from sheetoflight.report.target_sheet import target_sheet as t; "
        "from sheetoflight.model.target import CollinearTarget as C; t(C()); t(C(), 'pdf'); "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
