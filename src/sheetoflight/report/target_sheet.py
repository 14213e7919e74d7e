"""The target to print, true to scale: vector drawings as SVG or PDF."""

from __future__ import annotations

import io
from pathlib import PurePath
from typing import Any, Literal, get_args

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import Circle, PathPatch, Rectangle, Wedge
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D

from sheetoflight.errors import InputError
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.sheet_layout import (
    BAR_MM,
    LINE_MM,
    TEXT_MM,
    TICK_MM,
    SheetLayout,
    SheetPage,
    sheet_layout,
)

SheetFormat = Literal["svg", "pdf"]

MM_PER_INCH = 25.4
_POINTS_PER_MM = 72.0 / MM_PER_INCH
_HAIRLINE_MM = 0.15
_CUT_GREY = "0.6"
_MARK_GREY = "0.45"
_ALONG_AXIS = (-45.0, 135.0)
_ACROSS_AXIS = (45.0, 225.0)
_SMALL_TEXT_MM = 2.2
_LABEL_SHARE = 0.25


def sheet_format(path: str | PurePath) -> SheetFormat:
    """The format that a path's ending asks for.

    Raises
    ------
    InputError
        If the ending is neither ``.svg`` nor ``.pdf``.
    """
    ending = PurePath(path).suffix.lower().removeprefix(".")
    if ending == "svg":
        return "svg"
    if ending == "pdf":
        return "pdf"
    raise InputError(
        f"{path} ends in '.{ending}'" if ending else f"{path} has no ending",
        "a target is drawn as .svg or .pdf",
    )


def target_sheet(
    target: CollinearTarget,
    file_format: SheetFormat = "svg",
    page: SheetPage = "strip",
    strip_height_mm: float | None = None,
) -> bytes:
    """The target to print, true to scale, as a file's content.

    The same input gives the same bytes.

    Parameters
    ----------
    target : CollinearTarget
    file_format : {"svg", "pdf"}
    page : {"strip", "a4", "a3"}
        A page as large as the strip and its margins, or A4 or A3 landscape.
    strip_height_mm : float, optional
        Height of the white strip; twice the marker's size where absent.

    Raises
    ------
    InputError
        If the format is unknown, or the target does not fit (see `sheet_layout`).

    Examples
    --------
    >>> target_sheet(CollinearTarget(), "pdf")[:5]
    b'%PDF-'
    """
    if file_format not in get_args(SheetFormat):
        raise InputError(f"the format is '{file_format}'", "a target is drawn as svg or pdf")
    content = io.BytesIO()
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({"svg.hashsalt": "sheetoflight", "path.simplify": False})
        figure = draw_target(target, page, strip_height_mm)
        figure.savefig(content, format=file_format, metadata=_metadata(target, file_format))
    return content.getvalue()


def draw_target(
    target: CollinearTarget, page: SheetPage = "strip", strip_height_mm: float | None = None
) -> Figure:
    """The target as a figure whose axes fill the page and count millimetres.

    Parameters and errors are those of `target_sheet`.
    """
    layout = sheet_layout(target, page, strip_height_mm)
    figure = Figure(figsize=(layout.width / MM_PER_INCH, layout.height / MM_PER_INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, layout.width), ylim=(0, layout.height))
    axes.set_axis_off()
    _draw_strip(axes, layout)
    for index, x in enumerate(layout.marker_x):
        _draw_marker(axes, target, index, (x, layout.axis_y))
    _draw_zero(axes, layout, target.marker_size_mm)
    _draw_positions(axes, layout, target)
    _draw_bar(axes, layout)
    _draw_description(axes, layout, target)
    return figure


def _metadata(target: CollinearTarget, file_format: SheetFormat) -> dict[str, Any]:
    positions = ", ".join(f"{s:g}" for s in target.markers_mm)
    title = f"collinear target, {positions} mm"
    if file_format == "svg":
        return {"Title": title, "Date": None, "Creator": None}
    return {"Title": title, "CreationDate": None, "Creator": None, "Producer": None}


def _draw_strip(axes: Axes, layout: SheetLayout) -> None:
    corner = (layout.strip_x, layout.strip_y)
    style = {"facecolor": "white", "edgecolor": _CUT_GREY, "linestyle": (0, (12, 6))}
    strip = Rectangle(
        corner, layout.strip_width, layout.strip_height, linewidth=_pt(_HAIRLINE_MM), **style
    )
    _add(axes, strip, "strip")


def _draw_marker(
    axes: Axes, target: CollinearTarget, index: int, centre: tuple[float, float]
) -> None:
    radius = target.marker_size_mm / 2
    if target.marker == "disc":
        _add(axes, Circle(centre, radius, **_filled("black")), f"marker-{index}")
        return
    for quarter, start in enumerate(_ALONG_AXIS if index == 0 else _ACROSS_AXIS):
        wedge = Wedge(centre, radius, start, start + 90.0, **_filled("black"))
        _add(axes, wedge, f"marker-{index}-quarter-{quarter}")


def _draw_zero(axes: Axes, layout: SheetLayout, marker_size: float) -> None:
    """A small 0 in the strip's corner beside marker 0, well clear of the marker itself."""
    size = min(TEXT_MM, 0.2 * marker_size)
    place = (layout.strip_x + size / 2, layout.strip_y + size / 2)
    _add(axes, _text("0", place, size, _MARK_GREY), "end-mark-0")


def _draw_positions(axes: Axes, layout: SheetLayout, target: CollinearTarget) -> None:
    """A tick and the position in mm under every marker, outside the strip."""
    top = layout.strip_y - 0.5
    gaps = [b - a for a, b in zip(layout.marker_x, layout.marker_x[1:], strict=False)]
    size = min(TEXT_MM, _LABEL_SHARE * min(gaps))
    for index, (x, position) in enumerate(zip(layout.marker_x, target.markers_mm, strict=True)):
        tick = _polyline([(x, top), (x, top - TICK_MM)], _CUT_GREY)
        _add(axes, tick, f"tick-{index}")
        below = (x, top - TICK_MM - 0.5 - size)
        _add(axes, _text(f"{position:g}", below, size, "black", "middle"), f"position-{index}")


def _draw_bar(axes: Axes, layout: SheetLayout) -> None:
    """The bar that shows whether the printer kept the scale."""
    left, right = layout.left, layout.left + BAR_MM
    y = layout.strip_y - 3 * LINE_MM
    points = [(left, y + TICK_MM), (left, y), (right, y), (right, y + TICK_MM)]
    _add(axes, _polyline(points, "black"), "scale-bar")
    for tenth in range(1, 10):
        x = left + BAR_MM * tenth / 10
        tick = _polyline([(x, y), (x, y + TICK_MM / 2)], "black")
        _add(axes, tick, f"scale-bar-tenth-{tenth}")
    note = _text(f"check with a ruler: {BAR_MM:g} mm", (left, y - LINE_MM), TEXT_MM, "black")
    _add(axes, note, "scale-bar-text")


def _draw_description(axes: Axes, layout: SheetLayout, target: CollinearTarget) -> None:
    lines = (
        f"{len(target.markers_mm)} markers over {target.length_mm:g} mm, positions in mm · "
        f"{target.marker}, {target.marker_size_mm:g} mm",
        "print at 100 %, cut along the dashed line, glue flat; "
        "measure the positions, write them into rig.toml",
    )
    for number, line in enumerate(lines):
        place = (layout.left, layout.strip_y - (5 + number) * LINE_MM)
        _add(axes, _text(line, place, _SMALL_TEXT_MM, "black"), f"description-{number}")


def _add(axes: Axes, artist: PathPatch | Rectangle | Circle | Wedge, name: str) -> Artist:
    artist.set_gid(name)
    return axes.add_patch(artist)


def _filled(colour: str) -> dict[str, Any]:
    """Filled without an outline, which would enlarge the shape by half its width."""
    return {"facecolor": colour, "edgecolor": "none"}


def _polyline(points: list[tuple[float, float]], colour: str) -> PathPatch:
    width = _pt(_HAIRLINE_MM)
    return PathPatch(Outline(points), facecolor="none", edgecolor=colour, linewidth=width)


def _text(
    text: str, place: tuple[float, float], size_mm: float, colour: str, anchor: str = "start"
) -> PathPatch:
    """Text as outlines, `size_mm` high: no printer has to find the font."""
    outline = _outline(text, size_mm)
    extents = outline.get_extents()
    shift = -(extents.x0 + extents.x1) / 2 if anchor == "middle" else -extents.x0
    moved = outline.transformed(Affine2D().translate(place[0] + shift, place[1]))
    return PathPatch(moved, **_filled(colour))


def _outline(text: str, size_mm: float) -> TextPath:
    """Outline whose unit is the millimetre; digits of DejaVu Sans are 0.729 of its size high."""
    return TextPath((0, 0), text, size=size_mm / 0.729, prop=FontProperties("DejaVu Sans"))


def _pt(mm: float) -> float:
    return mm * _POINTS_PER_MM
