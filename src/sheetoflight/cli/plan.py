"""``sol plan``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.markup import escape
from rich.table import Table

from sheetoflight.calibration.plan import ViewCounts
from sheetoflight.cli.telling import (
    AsJson,
    Output,
    on_all_cores,
    plain_table,
    refuse_to_overwrite,
    tell,
    tell_json,
    tell_table,
)
from sheetoflight.errors import InputError
from sheetoflight.io.plan_json import plan_document, write_plan
from sheetoflight.measurement.expected_lengths import DIRECTIONS
from sheetoflight.measurement.length_plan import (
    Expected,
    ExpectedField,
    LengthPlan,
    PlanOptions,
)
from sheetoflight.report.plan_words import (
    next_in_words,
    three_digits,
    views_in_words,
    wanted_in_words,
)
from sheetoflight.workflow.planned import plan as planned
from sheetoflight.workflow.planned import write_plan_page

_DEFAULT = PlanOptions()


def plan(
    rig: Annotated[Path, Parameter(name="RIG")],
    /,
    *,
    calibration: Path | None = None,
    camera_views: int = _DEFAULT.counts.camera,
    plane_views: int = _DEFAULT.counts.plane,
    crossing_views: int = _DEFAULT.counts.crossing,
    length_mm: float | None = None,
    wanted_mm: float | None = None,
    best: Annotated[bool, Parameter(negative=())] = False,
    seed: int = _DEFAULT.seed,
    output: Output = None,
    page: Path | None = None,
    json: AsJson = False,
) -> None:
    """What uncertainty of lengths to expect, before any picture is taken.

    Parameters
    ----------
    rig
        The rig.toml with its table [plan], or the folder that holds it.
    calibration
        A calibration.json to take camera, sheets and noise from in place of [plan]; the next
        position is then told for the views that it was made with.
    camera_views
        Pictures of the target pivoting about marker 0.
    plane_views
        Positions of the target in each sheet of light.
    crossing_views
        Pictures of the target crossed by each sheet.
    length_mm
        The length whose uncertainty is told; the target's where absent, or a half, a quarter …
        of it where that fits too rarely into the picture.
    wanted_mm
        A standard uncertainty: how many positions reach it?
    best
        Choose the views that help most, one after the other, and compare them with random ones.
    seed
        Of the random views; the same seed gives the same plan.
    output
        Where to write the plan as JSON.
    page
        Where to write the plan as a page, .html.
    json
        Print the plan as JSON.
    """
    outputs = [path for path in (output, page) if path]
    for path in outputs:
        refuse_to_overwrite(path, [rig, *([calibration] if calibration else [])])
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise InputError(f"{output} is to be both JSON and page", "name two files")
    counts = ViewCounts(camera_views, plane_views, crossing_views)
    options = PlanOptions(counts, length_mm, wanted_mm, best, seed)
    with on_all_cores() as run:
        found = planned(rig, options, calibration, run)
    if output:
        write_plan(output, found)
    if page:
        write_plan_page(page, found)
    if json:
        tell_json(plan_document(found))
        return
    _tell(found)
    for path in outputs:
        tell(f"written to {path}")


def _tell(found: LengthPlan) -> None:
    for assumption in found.assumptions:
        tell(f"assumed: {assumption}")
    _tell_headline(found)
    tell_table(_positions(found))
    tell("place by place, the middle of the length seen at column u, row v:")
    several = len(found.coarse) > 1
    for field in found.coarse:
        for axis, direction in enumerate(DIRECTIONS):
            of = f" in the sheet of {escape(field.laser)}" if several else ""
            tell_table(_field(field, axis, f"{found.length_mm:g} mm{of} {direction}"))
    for sentence in wanted_in_words(found, found.wanted) if found.wanted else ():
        tell(sentence)
    for sentence in next_in_words(found):
        tell(sentence)


def _tell_headline(found: LengthPlan) -> None:
    expected, image = found.expected, dict(found.budget).get("image points", 0.0)
    rest = [(name, part) for name, part in found.budget if name != "image points"]
    calibration = math.hypot(*(part for _, part in rest))
    sources = ", ".join(f"{name} {three_digits(part)}" for name, part in rest)
    tell(f"{views_in_words(found)}:")
    tell(
        f"a length of {found.length_mm:g} mm will be known to {three_digits(found.headline_mm)} mm "
        "(standard uncertainty, median over the field)"
    )
    tell(
        f"  of that the calibration {three_digits(calibration)} mm ({sources}), "
        f"the image points of its ends {three_digits(image)} mm"
    )
    tell(
        f"  four fifths of all random sets of so many views give {three_digits(expected.low)} to "
        f"{three_digits(expected.high)} mm"
    )


def _positions(found: LengthPlan) -> Table:
    chosen = found.expected.best is not None
    table = plain_table(
        "Standard uncertainty in mm, median over the field",
        (),
        (
            "positions",
            "random views",
            "four fifths of them",
            *(("chosen views",) if chosen else ()),
        ),
    )
    for positions, row in found.table:
        style = "bold" if positions == found.options.counts.plane else None
        table.add_row(str(positions), *_cells(row), style=style)
    return table


def _cells(row: Expected) -> list[str]:
    chosen = [] if row.best is None else [three_digits(row.best)]
    return [
        three_digits(row.median),
        f"{three_digits(row.low)} – {three_digits(row.high)}",
        *chosen,
    ]


def _field(field: ExpectedField, axis: int, title: str) -> Table:
    table = plain_table(
        f"{title}, standard uncertainty in mm",
        (),
        ("v \\ u", *(f"{u:.0f}" for u in field.u)),
    )
    for v, row in zip(field.v, field.std_mm[axis], strict=True):
        cells = [three_digits(float(std)) if np.isfinite(std) else "–" for std in row]
        table.add_row(f"{v:.0f}", *cells)
    return table
