"""Where everything on a printed target goes, in millimetres from the page's lower left corner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from sheetoflight.errors import InputError
from sheetoflight.model.target import CollinearTarget

SheetPage = Literal["strip", "a4", "a3"]

TEXT_MM = 3.0
LINE_MM = 5.0
MARGIN_MM = 8.0
TICK_MM = 2.0
BAR_MM = 100.0

_LANDSCAPE_MM: dict[str, tuple[float, float]] = {"a4": (297.0, 210.0), "a3": (420.0, 297.0)}
_LINES_BELOW = 6
_NARROWEST_PAGE = 170.0
_SMALLEST_BORDER = 1.25


@dataclass(frozen=True)
class SheetLayout:
    """A printed target's places and sizes, all in mm; x right and y up from the lower left.

    Parameters
    ----------
    width, height : float
        Size of the page.
    strip_x, strip_y, strip_width, strip_height : float
        Lower left corner and size of the strip that is cut out.
    axis_y : float
        Height of the markers' centres.
    marker_x : tuple of float
        Place of each marker's centre.
    left : float
        Where the bar and the text below the strip begin.
    """

    width: float
    height: float
    strip_x: float
    strip_y: float
    strip_width: float
    strip_height: float
    axis_y: float
    marker_x: tuple[float, ...]
    left: float


def sheet_layout(
    target: CollinearTarget,
    page: SheetPage = "strip",
    strip_height_mm: float | None = None,
) -> SheetLayout:
    """Lay out a target's strip on a page, with room for the text below it.

    Parameters
    ----------
    target : CollinearTarget
    page : {"strip", "a4", "a3"}
        A page as large as the strip and its margins, or A4 or A3 landscape.
    strip_height_mm : float, optional
        Height of the strip; twice the marker's size where absent.

    Raises
    ------
    InputError
        If markers overlap, the strip is too low for a white border, or the page too small.
    """
    if page not in get_args(SheetPage):
        raise InputError(f"the page is '{page}'", f"choose {' | '.join(get_args(SheetPage))}")
    _check_markers(target)
    strip_height = _strip_height(target, strip_height_mm)
    strip_width = target.length_mm + 2 * target.marker_size_mm
    needed = (
        max(strip_width + 2 * MARGIN_MM, _NARROWEST_PAGE),
        strip_height + _LINES_BELOW * LINE_MM + 2 * MARGIN_MM,
    )
    width, height = needed if page == "strip" else _fixed_page(page, needed, target)
    strip_x = (width - strip_width) / 2
    strip_y = height - MARGIN_MM - strip_height
    return SheetLayout(
        width=width,
        height=height,
        strip_x=strip_x,
        strip_y=strip_y,
        strip_width=strip_width,
        strip_height=strip_height,
        axis_y=strip_y + strip_height / 2,
        marker_x=tuple(strip_x + target.marker_size_mm + s for s in target.markers_mm),
        left=min(strip_x, (width - _NARROWEST_PAGE) / 2 + MARGIN_MM),
    )


def _check_markers(target: CollinearTarget) -> None:
    gaps = [b - a for a, b in zip(target.markers_mm, target.markers_mm[1:], strict=False)]
    if min(gaps) <= target.marker_size_mm:
        raise InputError(
            f"two markers lie {min(gaps):g} mm apart, but each is {target.marker_size_mm:g} mm "
            "in diameter; they would overlap",
            f"set marker_size_mm below {min(gaps):g}, or move the markers apart",
        )


def _strip_height(target: CollinearTarget, strip_height_mm: float | None) -> float:
    if strip_height_mm is None:
        return 2 * target.marker_size_mm
    smallest = _SMALLEST_BORDER * target.marker_size_mm
    if not (math.isfinite(strip_height_mm) and strip_height_mm >= smallest):
        raise InputError(
            f"the strip is {strip_height_mm:g} mm high; markers of {target.marker_size_mm:g} mm "
            f"need a white border, at least {smallest:g} mm in all",
            "give a larger strip_height_mm, or leave it out",
        )
    return strip_height_mm


def _fixed_page(
    page: str, needed: tuple[float, float], target: CollinearTarget
) -> tuple[float, float]:
    width, height = _LANDSCAPE_MM[page]
    if needed[0] <= width and needed[1] <= height:
        return width, height
    sizes = _LANDSCAPE_MM.items()
    larger = [name for name, (w, h) in sizes if needed[0] <= w and needed[1] <= h]
    longest = width - 2 * MARGIN_MM - 2 * target.marker_size_mm
    too_long = needed[0] > width and needed[1] <= height and longest > 0
    shorter = f", or a target of at most {longest:g} mm" if too_long else ""
    raise InputError(
        f"the target needs a page of {needed[0]:g} × {needed[1]:g} mm, "
        f"{page.upper()} landscape has {width:g} × {height:g} mm",
        f"choose page {' or '.join([*larger, 'strip'])}{shorter}",
    )
