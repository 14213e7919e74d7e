"""The figures of the page with their titles, captions and data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import plotly.graph_objects as go
import plotly.io
from markupsafe import Markup

from sheetoflight.model.calibration import Calibration
from sheetoflight.report import figures, mean_residuals, space
from sheetoflight.report.budget import Budget
from sheetoflight.report.budget_figure import budget_bars
from sheetoflight.report.point_groups import point_groups

_DRAWN = {
    "markers": "markers of one view are joined",
    "spots": "spots of a laser are crosses",
    "board": "boards are drawn as outlines through their outermost points",
}
"""Words for the kinds of `point_groups`."""
_PLACED = " In stage plane the target's distance from the sheet adds to the noise."
_MANY, _MOST_ARROWS = 400, 2500
"""From how many points on their means are drawn, and up to how many every one of them is."""

_MOST_BARS = 40
_BAR_REM, _AROUND_BARS_REM = 2.4, 8.0


@dataclass(frozen=True)
class Plot:
    """A plotly figure as the page needs it: an id of its own, texts, the data as JSON, and a
    height where that of its kind does not suit it."""

    id: str
    title: str
    caption: str
    json: Markup
    kind: Literal["flat", "tall", "space"] = "flat"
    height_rem: float | None = None


def plot(
    figure: go.Figure,
    name: str,
    title: str,
    caption: str,
    kind: Literal["flat", "tall", "space"] = "flat",
    height_rem: float | None = None,
) -> Plot:
    """A figure made ready for the page; `name` is its id there."""
    figure.update_layout(template="none")
    # plotly writes <, > and / as \u escapes, so the JSON cannot close its script element.
    json = plotly.io.to_json(figure, engine="json")
    return Plot(name, title, caption, Markup(json), kind, height_rem)


def budget_plot(budgets: Sequence[Budget]) -> Plot | None:
    """What the uncertainty of each length is made of; None where nothing is known of it."""
    shown = [budget for budget in budgets if budget.std > 0][:_MOST_BARS]
    if not shown:
        return None
    rest = len(budgets) - len(shown)
    return plot(
        budget_bars(shown),
        "figure-budget",
        "What limits a length",
        "Shares of the variance. Who wants to measure better begins with the longest piece."
        + (f" The table also has the {rest} lengths that are not drawn." if rest else ""),
        "flat",
        _BAR_REM * len(shown) + _AROUND_BARS_REM,
    )


def _what_is_drawn(calibration: Calibration) -> str:
    """How the figure in the picture shows what there is."""
    kinds = _kinds(calibration)
    said = ", ".join(words for kind, words in _DRAWN.items() if kind in kinds)
    paper = " The paper's figure 4." if "markers" in kinds else ""
    return f"{said[0].upper()}{said[1:]}; the frame is the picture.{paper}"


def _kinds(calibration: Calibration) -> set[str]:
    return {group.kind for group in point_groups(calibration)}


def _title_in_space(calibration: Calibration) -> str:
    planes = len(calibration.light_planes)
    return f"Targets and {('camera', 'sheet of light', 'sheets of light')[min(planes, 2)]} in space"


def calibration_plots(calibration: Calibration) -> list[Plot]:
    """Where the targets were seen, and where they stood."""
    in_space = plot(
        space.points_and_sheets(calibration),
        "figure-space",
        _title_in_space(calibration),
        "Camera frame in mm; turn it with the mouse."
        + (" The paper's figure 5." if _kinds(calibration) != {"board"} else ""),
        "space",
    )
    if not calibration.residuals.views:
        return [in_space]
    in_picture = plot(
        figures.image_points(calibration),
        "figure-image-points",
        "Image points of the targets",
        _what_is_drawn(calibration),
        "tall",
    )
    return [in_picture, in_space]


def residual_plots(calibration: Calibration) -> list[Plot]:
    """How the observations fit: by view, over the picture, by component."""
    if not calibration.residuals.views:
        return []
    sources = {source.name for source in calibration.covariance.sources}
    placed = _PLACED if "placement" in sources else ""
    return [
        plot(
            figures.residual_bars(calibration),
            "figure-residual-views",
            "Residuals, view by view",
            "A view that stands out has a wrong marker, a bent or moved target, or blur." + placed,
        ),
        *_over_the_picture(calibration),
        plot(
            figures.residual_scatter(calibration),
            "figure-residual-scatter",
            "Residuals by component",
            "Circles at 1, 2 and 3 times the noise. Errors of that size alone would leave 39, 86 "
            "and 99 % of the points inside them; the fit itself takes up some more." + placed,
            "tall",
        ),
    ]


def _over_the_picture(calibration: Calibration) -> list[Plot]:
    """Every residual where they are few enough to be told apart, means where they are many."""
    groups = point_groups(calibration)
    arrows = plot(
        figures.residual_arrows(calibration),
        "figure-residual-arrows",
        "Residuals over the picture",
        "Observed minus predicted, drawn from each point's dot. Where neighbours agree, the "
        "lens model is too simple.",
        "tall",
    )
    if sum(group.seen for group in groups if group.kind == "board") < _MANY:
        return [arrows]
    means = plot(
        mean_residuals.residual_means(calibration),
        "figure-residual-means",
        "Mean residuals over the picture",
        "Of the boards' points, square by square. Noise alone would leave 19 of 20 arrows within "
        "their circles; where neighbours leave them the same way, the lens model is too simple, "
        "or the board is not flat.",
        "tall",
    )
    return [arrows, means] if sum(group.seen for group in groups) <= _MOST_ARROWS else [means]
