"""Figures of a plan (plotly, two dimensions)."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from sheetoflight.measurement.length_plan import ExpectedField, LengthPlan
from sheetoflight.report.figures import NEUTRAL, frame_of_picture, image_points, label

_SETS_COLOUR, _CHOSEN_COLOUR, _NEXT_COLOUR = "#3b82c4", "#d9622b", "#c2362c"
_SCALE = "Viridis"


def field_map(plan: LengthPlan, field: ExpectedField, axis: int) -> go.Figure:
    """Standard uncertainty over the picture, for a length along its rows or columns."""
    figure = go.Figure()
    std = field.std_mm[axis]
    parts = np.stack([field.calibration_mm[axis], field.image_mm[axis], field.depth_mm], axis=-1)
    figure.add_heatmap(
        x=field.u,
        y=field.v,
        z=std,
        customdata=parts,
        colorscale=_SCALE,
        colorbar={"title": {"text": "mm"}},
        hoverongaps=False,
        hovertemplate="u %{x:.0f}, v %{y:.0f} px, Z %{customdata[2]:.0f} mm<br>%{z:.3g} mm: "
        "calibration %{customdata[0]:.3g}, image points %{customdata[1]:.3g}<extra></extra>",
    )
    frame_of_picture(figure, plan.calibration.camera.image_size)
    return figure


def over_positions(plan: LengthPlan) -> go.Figure:
    """Median uncertainty over the number of positions in the sheet."""
    figure = go.Figure()
    rows = [(n, row) for n, row in plan.table if np.isfinite(row.high)]
    numbers = [n for n, _ in rows]
    figure.add_scatter(
        x=[*numbers, *numbers[::-1]],
        y=[*(row.high for _, row in rows), *(row.low for _, row in reversed(rows))],
        mode="lines",
        fill="toself",
        fillcolor="rgba(59, 130, 196, 0.15)",
        line={"width": 0},
        name="four fifths of random sets",
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=numbers,
        y=[row.median for _, row in rows],
        mode="lines+markers",
        name="random views, median",
        line={"color": _SETS_COLOUR},
        hovertemplate="%{x} positions: %{y:.3g} mm<extra></extra>",
    )
    chosen = [(n, row.best) for n, row in rows if row.best is not None and np.isfinite(row.best)]
    if chosen:
        figure.add_scatter(
            x=[n for n, _ in chosen],
            y=[best for _, best in chosen],
            mode="lines+markers",
            name="chosen views",
            line={"color": _CHOSEN_COLOUR},
            hovertemplate="%{x} positions: %{y:.3g} mm<extra></extra>",
        )
    if plan.options.wanted_mm is not None:
        figure.add_hline(y=plan.options.wanted_mm, line={"color": NEUTRAL, "dash": "dash"})
    figure.update_xaxes(title="positions in the sheet", type="log", tickvals=numbers)
    figure.update_yaxes(title="standard uncertainty, mm", rangemode="tozero")
    return figure


def planned_views(plan: LengthPlan) -> go.Figure:
    """The planned views in the picture, and the next ones."""
    figure = image_points(plan.calibration)
    for position in plan.next_positions:
        view = position.view
        figure.add_scatter(
            x=view.uv[:, 0],
            y=view.uv[:, 1],
            mode="lines+markers",
            name=f"next: {label(view.stage)}",
            line={"color": _NEXT_COLOUR, "width": 3},
            marker={"color": _NEXT_COLOUR, "size": [13] + [8] * (len(view.uv) - 1)},
            hovertemplate="u %{x:.0f}, v %{y:.0f} px<extra></extra>",
        )
    return figure
