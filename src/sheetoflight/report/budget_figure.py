"""What an uncertainty is made of as bars (plotly, two dimensions)."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from sheetoflight.report.budget import Budget, sources_of
from sheetoflight.report.figures import OTHER_COLOUR, STAGE_COLOURS, label

SOURCE_COLOURS = {
    "camera": STAGE_COLOURS["camera"],
    "sheet": STAGE_COLOURS["plane"],
    "crossing": STAGE_COLOURS["crossing"],
    "board": STAGE_COLOURS["board"],
    "line": "#e8a13a",
    "lines off the sheet": "#b5524a",
    "board print": "#7cc4a5",
    "board length": "#0f6b52",
    "placement": "#a2426b",
    "target length": "#4f7fa3",
    "temperature": "#6b8e23",
    "image points": "#7d8791",
    "calibration": STAGE_COLOURS["camera"],
}
_LEAST_LABELLED = 4.0


def budget_bars(budgets: Sequence[Budget]) -> go.Figure:
    """One bar for each budget: the sources' shares of its variance in per cent."""
    figure = go.Figure()
    places = list(range(len(budgets)))
    for source in sources_of(budgets):
        having = [place for place in places if source in dict(budgets[place].shares)]
        percent = [100.0 * budgets[place].part(source) for place in having]
        figure.add_bar(
            x=percent,
            y=having,
            orientation="h",
            name=label(source),
            marker={"color": SOURCE_COLOURS.get(source, OTHER_COLOUR)},
            text=[f"{part:.0f}" if part >= _LEAST_LABELLED else "" for part in percent],
            textposition="inside",
            insidetextanchor="middle",
            textangle=0,
            hovertext=[
                f"{label(budgets[place].name)}: {dict(budgets[place].shares)[source]:.2g} "
                f"{budgets[place].unit}"
                for place in having
            ],
            hovertemplate=f"%{{hovertext}}, %{{x:.1f}} % from {label(source)}<extra></extra>",
        )
    figure.update_layout(barmode="stack", bargap=0.35, legend={"traceorder": "normal"})
    figure.update_xaxes(title="share of the variance, %", range=[0, 100], zeroline=False)
    figure.update_yaxes(
        tickvals=places,
        ticktext=[label(budget.name) for budget in budgets],
        range=[len(budgets) - 0.5, -0.5],
        showgrid=False,
        zeroline=False,
    )
    return figure
