"""A plan as one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from sheetoflight.measurement.expected_lengths import DIRECTIONS
from sheetoflight.measurement.length_plan import ExpectedField, LengthPlan
from sheetoflight.report import plan_figures
from sheetoflight.report.environment import environment
from sheetoflight.report.plan_words import (
    next_in_words,
    three_digits,
    views_in_words,
    wanted_in_words,
)
from sheetoflight.report.plots import Plot, plot


def build_plan_page(plan: LengthPlan) -> str:
    """What to expect of a rig as one HTML page: maps, tables, the next position, assumptions.

    The page holds its figures and the code that draws them, and forbids the browser to load
    anything else. The same input gives the same text.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    return (
        environment()
        .get_template("plan.html")
        .render(
            plan=plan,
            length=f"{plan.length_mm:g}",
            views=views_in_words(plan),
            headline=three_digits(plan.headline_mm),
            low=three_digits(plan.expected.low),
            high=three_digits(plan.expected.high),
            budget=[(name, three_digits(part)) for name, part in plan.budget],
            positions=_positions(plan),
            tables=_tables(plan),
            maps=_maps(plan),
            over_positions=plot(
                plan_figures.over_positions(plan),
                "figure-positions",
                "Uncertainty over the number of positions",
                "Median over the field. The band holds four fifths of all random sets of views"
                + (", the dashed line is what is wanted." if plan.wanted else "."),
            ),
            planned_views=plot(
                plan_figures.planned_views(plan),
                "figure-views",
                "The planned views",
                "A typical random set, or the chosen one, and what would help most next: marker 0 "
                "is drawn larger.",
                "tall",
            ),
            wanted=wanted_in_words(plan, plan.wanted) if plan.wanted else (),
            next=next_in_words(plan),
            provenance=_provenance(plan),
        )
    )


def _positions(plan: LengthPlan) -> list[tuple[bool, list[str]]]:
    """Rows of the table over positions, and whether each is the planned number."""
    rows = []
    for number, row in plan.table:
        chosen = [] if row.best is None else [three_digits(row.best)]
        cells = [three_digits(x) for x in (row.median, row.low, row.high)]
        rows.append((number == plan.options.counts.plane, [str(number), *cells, *chosen]))
    return rows


def _tables(plan: LengthPlan) -> list[dict[str, object]]:
    return [
        _table(field, axis, _title(plan, field, axis))
        for field in plan.coarse
        for axis in range(len(DIRECTIONS))
    ]


def _title(plan: LengthPlan, field: ExpectedField, axis: int) -> str:
    of = f" in the sheet of {field.laser}" if len(plan.coarse) > 1 else ""
    return f"{plan.length_mm:g} mm{of} {DIRECTIONS[axis]}"


def _table(field: ExpectedField, axis: int, title: str) -> dict[str, object]:
    std = field.std_mm[axis]
    darkest = float(np.nanmax(field.std_mm)) if np.isfinite(field.std_mm).any() else 1.0
    rows = []
    for v, values, depths in zip(field.v, std, field.depth_mm, strict=True):
        cells = [
            (
                three_digits(float(x)) if np.isfinite(x) else "–",
                f"Z {z:.0f}" if np.isfinite(z) else "",
                round(float(x) / darkest, 3) if np.isfinite(x) else 0.0,
            )
            for x, z in zip(values, depths, strict=True)
        ]
        rows.append((f"{v:.0f}", cells))
    return {"title": title, "columns": [f"{u:.0f}" for u in field.u], "rows": rows}


def _maps(plan: LengthPlan) -> list[Plot]:
    return [
        plot(
            plan_figures.field_map(plan, field, axis),
            f"figure-map-{number}-{axis}",
            _title(plan, field, axis),
            "Standard uncertainty with the middle of the length seen there. Nothing is drawn where "
            "the length leaves the picture, or the sheet the depths.",
            "tall",
        )
        for number, field in enumerate(plan.fine)
        for axis in range(len(DIRECTIONS))
    ]


def _provenance(plan: LengthPlan) -> list[tuple[str, str]]:
    camera, nominal = plan.nominal.camera, plan.nominal
    rows = [
        ("software", f"sheetoflight {version('sheetoflight')}"),
        ("rig", Path(plan.rig.source).name or "–"),
        ("picture", f"{camera.image_size[0]} × {camera.image_size[1]} px"),
        ("focal length", f"{camera.alpha:.1f} px"),
        ("target", f"{', '.join(f'{s:g}' for s in plan.rig.target.markers_mm)} mm"),
        ("tolerance_mm", f"{plan.rig.target.tolerance_mm:g}"),
        ("pixel_std", f"{plan.rig.pixel_std:.3g} px"),
        ("placement_std_mm", f"{plan.rig.placement_std:.3g}"),
        ("depths", f"{nominal.depth_mm[0]:.0f} to {nominal.depth_mm[1]:.0f} mm"),
        ("pivot", ", ".join(f"{x:.0f}" for x in nominal.pivot_mm) + " mm"),
        ("seed", str(plan.options.seed)),
    ]
    for plane in nominal.light_planes:
        normal = ", ".join(f"{x:.4f}" for x in plane.normal)
        rows.append((f"sheet of {plane.name}", f"n = ({normal}), d = {plane.distance_mm:.1f} mm"))
    return rows
