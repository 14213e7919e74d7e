"""The report: one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sheetoflight.model.calibration import Calibration
from sheetoflight.report import numbers
from sheetoflight.report.budget import Budget, budget_table, length_budget, parameter_budgets
from sheetoflight.report.contents import MeasuredPicture, Table
from sheetoflight.report.diagnosis_block import diagnosis
from sheetoflight.report.environment import environment
from sheetoflight.report.length_field import LengthField, field_tables, length_fields, summary
from sheetoflight.report.monte_carlo_block import monte_carlo_tables
from sheetoflight.report.noise import (
    NO_SIZE,
    NoiseRow,
    image_noise,
    noise_origin,
    noise_rows,
)
from sheetoflight.report.picture_block import picture_blocks
from sheetoflight.report.plots import budget_plot, calibration_plots, residual_plots
from sheetoflight.report.point_groups import in_sheet, largest_px, point_groups, stages_of
from sheetoflight.report.second_opinion_block import second_opinion_tables

_SENSOR = ("Camera", "Camera and sheet of light", "Camera and sheets of light")
"""What was calibrated, by the number of sheets."""


def build_report(
    calibration: Calibration,
    pictures: Sequence[MeasuredPicture] = (),
    tables: Sequence[Table] = (),
) -> str:
    """The report on a calibration, as one HTML page.

    The page holds its pictures, figures and the code that draws them, and forbids the browser
    to load anything else. The same input gives the same text.

    Parameters
    ----------
    calibration : Calibration
    pictures : sequence of MeasuredPicture
        Pictures of the calibrated camera with the lengths that were measured in them.
    tables : sequence of Table
        Shown as they are given, behind those of the second opinion and of the Monte Carlo where
        they were made.

    Returns
    -------
    str
        HTML, to be written as UTF-8.

    Raises
    ------
    InputError
        If a picture has another size than the calibrated camera's.
    """
    fields = length_fields(calibration)
    budgets = _length_budgets(calibration, fields, pictures)
    by_parameter = parameter_budgets(calibration.covariance)
    known = bool(calibration.covariance.parameters)
    noise = noise_rows(calibration)
    return (
        environment()
        .get_template("page.html")
        .render(
            calibration=calibration,
            several=len(calibration.light_planes) > 1,
            sensor=_SENSOR[min(len(calibration.light_planes), 2)],
            noise_words=numbers.noise_in_words(calibration),
            noise=noise,
            pixel_origin=noise_origin(calibration, image_noise(calibration)),
            placement=_placement(noise),
            diagnosis=diagnosis(calibration),
            stages=_stage_counts(calibration),
            groups=_group_rows(calibration),
            boards=_board_rows(calibration),
            fields=[(summary(field), field_tables(field)) for field in fields],
            budget=budget_table(budgets, known),
            sources=budget_table([*budgets, *by_parameter]).meanings,
            budget_plot=budget_plot(budgets) if known else None,
            parameters=budget_table(by_parameter) if known else None,
            camera=numbers.camera_quantities(calibration),
            planes=[
                (
                    p.name,
                    numbers.plane_quantities(calibration, p),
                    numbers.paper_equation(p),
                    numbers.bend_in_words(calibration, p, in_sheet(calibration, laser)),
                )
                for laser, p in enumerate(calibration.light_planes)
            ],
            view=numbers.view_quantities(calibration),
            calibration_plots=calibration_plots(calibration),
            residual_plots=residual_plots(calibration),
            pictures=picture_blocks(calibration, pictures),
            tables=(
                *second_opinion_tables(calibration),
                *monte_carlo_tables(calibration),
                *tables,
            ),
            provenance=tuple(numbers.flat(calibration.provenance)),
        )
    )


def _length_budgets(
    calibration: Calibration,
    fields: Sequence[LengthField],
    pictures: Sequence[MeasuredPicture],
) -> list[Budget]:
    """Of an expected length in each sheet, then of every measured one."""
    several = len(calibration.light_planes) > 1
    expected = [
        length_budget(
            f"{field.length_mm:g} mm in the sheet{f' {field.laser}' if several else ''}, median",
            field.typical,
        )
        for field in fields
    ]
    measured = [
        length_budget(segment.name, segment.length)
        for picture in pictures
        for segment in picture.segments
    ]
    return [*expected, *measured]


def _placement(rows: Sequence[NoiseRow]) -> tuple[str, str] | None:
    """Size of the placement error in mm and where it comes from; None where there is none."""
    sized = [row for row in rows if row.name == "placement" and row.size not in NO_SIZE]
    return (sized[0].size, sized[0].origin) if sized else None


def _stage_counts(calibration: Calibration) -> list[tuple[str, int]]:
    """Name and number of views of each stage."""
    views = calibration.residuals.views
    return [(stage, sum(v.stage == stage for v in views)) for stage in stages_of(views)]


def _group_rows(calibration: Calibration) -> list[tuple[str, int, int, str, str]]:
    """Title, number of views, number of points, rms and largest residual of each group."""
    return [
        (group.title, len(group), group.seen, _px(group.rms_px), _px(group.largest_px))
        for group in point_groups(calibration)
    ]


def _board_rows(calibration: Calibration) -> list[tuple[str, str, str, str]]:
    """Name, points seen of all, rms and largest residual of each view of a board."""
    rows = []
    for view in calibration.residuals.views:
        if view.stage == "board":
            seen = int(np.isfinite(view.uv).all(axis=1).sum())
            rms, largest = _px(view.rms_px if seen else math.nan), _px(largest_px(view.residuals))
            rows.append((view.view, f"{seen} of {len(view.uv)}", rms, largest))
    return rows


def _px(residual: float) -> str:
    return numbers.two_digits(residual) if math.isfinite(residual) else "–"
