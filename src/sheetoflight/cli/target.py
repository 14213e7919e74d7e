"""``sol target``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sheetoflight.cli.telling import tell
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.reported import write_target

_DEFAULT = CollinearTarget()


def target(
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    markers_mm: Annotated[
        tuple[float, ...], Parameter(consume_multiple=True)
    ] = _DEFAULT.markers_mm,
    marker: Literal["quadrant", "disc"] = _DEFAULT.marker,
    marker_size_mm: float = _DEFAULT.marker_size_mm,
    page: Literal["strip", "a4", "a3"] = "strip",
) -> None:
    """Draw a target to print, true to scale, as SVG or PDF.

    Parameters
    ----------
    output
        The drawing, OUT.svg or OUT.pdf.
    markers_mm
        Position of every marker from marker 0 in mm.
    marker
        quadrant: a disc in four black and white quarters. disc: a plain disc.
    marker_size_mm
        Diameter of a marker in mm.
    page
        A page as large as the strip, or A4 or A3 landscape.
    """
    drawn = CollinearTarget(markers_mm, marker=marker, marker_size_mm=marker_size_mm)
    write_target(output, drawn, page)
    tell(f"written to {output}")
