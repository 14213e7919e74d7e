"""The report: one self-contained page that loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from sheetoflight.model.calibration import Calibration
from sheetoflight.report import numbers
from sheetoflight.report.contents import MeasuredPicture, Table
from sheetoflight.report.figures import stages_of
from sheetoflight.report.length_field import field_tables, length_field, summary
from sheetoflight.report.picture_block import picture_blocks
from sheetoflight.report.plots import calibration_plots, residual_plots


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
        Pictures of the calibrated camera; the length of every whole piece of the laser line
        is measured.
    tables : sequence of Table
        Shown as they are given.

    Returns
    -------
    str
        HTML, to be written as UTF-8.

    Raises
    ------
    InputError
        If a picture has another size than the calibrated camera's, or an end of a whole piece
        does not lie on the sheet of light.
    """
    field = length_field(calibration)
    return (
        _environment()
        .get_template("page.html")
        .render(
            calibration=calibration,
            noise=numbers.noise_in_words(calibration),
            stages=_stage_counts(calibration),
            field=summary(field),
            field_tables=field_tables(field),
            camera=numbers.camera_quantities(calibration),
            planes=[
                (p.name, numbers.plane_quantities(calibration, p), numbers.paper_equation(p))
                for p in calibration.light_planes
            ],
            view=numbers.view_quantities(calibration),
            calibration_plots=calibration_plots(calibration),
            residual_plots=residual_plots(calibration),
            pictures=picture_blocks(calibration, pictures),
            tables=tables,
            provenance=tuple(numbers.flat(calibration.provenance)),
            plotly_js=Markup(_plotly_js()),
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("sheetoflight.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["cell"] = _cell_text
    environment.filters["two_digits"] = numbers.two_digits
    return environment


@cache
def _plotly_js() -> str:
    return get_plotlyjs()


def _stage_counts(calibration: Calibration) -> list[tuple[str, int, str]]:
    """Name, number of views and rms residual of each stage."""
    views = calibration.residuals.views
    counts = []
    for stage in stages_of(views):
        of_stage = [view.residuals for view in views if view.stage == stage]
        residuals = np.concatenate(of_stage)
        seen = residuals[np.isfinite(residuals)]
        rms = numbers.two_digits(float(np.sqrt(np.mean(seen**2)))) if seen.size else "–"
        counts.append((stage, len(of_stage), rms))
    return counts


def _cell_text(cell: str | int | float) -> str:
    return f"{cell:.6g}" if isinstance(cell, float) else str(cell)
