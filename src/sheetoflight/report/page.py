"""The report: one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sheetoflight.model.calibration import Calibration
from sheetoflight.report import numbers
from sheetoflight.report.budget import Budget, budget_table, length_budget, parameter_budgets
from sheetoflight.report.contents import MeasuredPicture, Table
from sheetoflight.report.diagnosis_block import diagnosis
from sheetoflight.report.environment import environment
from sheetoflight.report.length_field import LengthField, field_tables, length_fields, summary
from sheetoflight.report.monte_carlo_block import monte_carlo_tables
from sheetoflight.report.noise import NO_SIZE, NoiseRow, noise_origin, noise_rows
from sheetoflight.report.picture_block import picture_blocks
from sheetoflight.report.plots import budget_plot, calibration_plots, residual_plots
from sheetoflight.report.point_groups import point_groups, stages_of


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
        Shown as they are given, behind those of the Monte Carlo where one was made.

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
    covariance = calibration.covariance
    known = bool(covariance.parameters)
    noise = noise_rows(calibration)
    return (
        environment()
        .get_template("page.html")
        .render(
            calibration=calibration,
            several=len(calibration.light_planes) > 1,
            noise_words=numbers.noise_in_words(calibration),
            noise=noise,
            pixel_origin=noise_origin(calibration, "pixel"),
            placement=_placement(noise),
            diagnosis=diagnosis(calibration),
            stages=_stage_counts(calibration),
            groups=_group_counts(calibration),
            fields=[(summary(field), field_tables(field)) for field in fields],
            budget=budget_table(budgets, known),
            budget_plot=budget_plot(budgets) if known else None,
            parameters=budget_table(parameter_budgets(covariance)) if known else None,
            camera=numbers.camera_quantities(calibration),
            planes=[
                (p.name, numbers.plane_quantities(calibration, p), numbers.paper_equation(p))
                for p in calibration.light_planes
            ],
            view=numbers.view_quantities(calibration),
            calibration_plots=calibration_plots(calibration),
            residual_plots=residual_plots(calibration),
            pictures=picture_blocks(calibration, pictures),
            tables=(*monte_carlo_tables(calibration), *tables),
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


def _group_counts(calibration: Calibration) -> list[tuple[str, int, str]]:
    """Title, number of views and rms residual of each group of points."""
    return [(group.title, len(group), _px(group.rms_px)) for group in point_groups(calibration)]


def _px(rms: float) -> str:
    return numbers.two_digits(rms) if math.isfinite(rms) else "–"
