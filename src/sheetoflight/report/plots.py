"""The figures of the page with their titles, captions and data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import plotly.graph_objects as go
import plotly.io
from markupsafe import Markup

from sheetoflight.model.calibration import Calibration
from sheetoflight.report import figures, space


@dataclass(frozen=True)
class Plot:
    """A plotly figure as the page needs it: an id of its own, texts, and the data as JSON."""

    id: str
    title: str
    caption: str
    json: Markup
    kind: Literal["flat", "tall", "space"] = "flat"


def plot(
    figure: go.Figure,
    name: str,
    title: str,
    caption: str,
    kind: Literal["flat", "tall", "space"] = "flat",
) -> Plot:
    """A figure made ready for the page; `name` is its id there."""
    figure.update_layout(template="none")
    # plotly writes <, > and / as \u escapes, so the JSON cannot close its script element.
    json = plotly.io.to_json(figure, engine="json")
    return Plot(name, title, caption, Markup(json), kind)


def calibration_plots(calibration: Calibration) -> list[Plot]:
    """Where the targets were seen, and where they stood."""
    in_space = plot(
        space.points_and_sheet(calibration),
        "figure-space",
        "Targets and sheet of light in space",
        "Camera frame in mm; turn it with the mouse. The paper's figure 5.",
        "space",
    )
    if not calibration.residuals.views:
        return [in_space]
    in_picture = plot(
        figures.image_points(calibration),
        "figure-image-points",
        "Image points of the targets",
        "Markers of one view are joined; the frame is the picture. The paper's figure 4.",
        "tall",
    )
    return [in_picture, in_space]


def residual_plots(calibration: Calibration) -> list[Plot]:
    """How the observations fit: by view, over the picture, by component."""
    if not calibration.residuals.views:
        return []
    return [
        plot(
            figures.residual_bars(calibration),
            "figure-residual-views",
            "Residuals, view by view",
            "A view that stands out has a wrong marker, a bent or moved target, or blur.",
        ),
        plot(
            figures.residual_arrows(calibration),
            "figure-residual-arrows",
            "Residuals over the picture",
            "Observed minus predicted, drawn from each marker's dot. Where neighbours agree, the "
            "lens model is too simple.",
            "tall",
        ),
        plot(
            figures.residual_scatter(calibration),
            "figure-residual-scatter",
            "Residuals by component",
            "Circles at 1, 2 and 3 times the noise. Errors of that size alone would leave 39, 86 "
            "and 99 % of the points inside them; the fit itself takes up some more.",
            "tall",
        ),
    ]
