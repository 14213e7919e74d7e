"""The figure of a comparison of methods (plotly, two dimensions)."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from sheetoflight.measurement.method_comparison import MethodComparison, MethodScore
from sheetoflight.report.figures import NEUTRAL

_COLOURS = (
    *("#d9622b", "#e8a13a", "#a2426b", "#3b82c4", "#7fb2e5"),
    *("#8a7fb8", "#1f9d78", "#7cc4a5", "#6b8e23"),
)
_SYMBOLS = ("circle", "square", "diamond", "cross", "x", "triangle-up", "star")
_APART = 0.035
"""By how much, relatively, the methods' marks of one length stand apart."""


def errors_by_length(comparison: MethodComparison) -> go.Figure:
    """Errors that the calibration alone causes over the length, and the bound of each as a dash
    in the same colour."""
    figure = go.Figure()
    scores = [score for score in comparison.scores if score.lengths]
    for place, score in enumerate(scores):
        across = (1.0 + _APART) ** (place - 0.5 * (len(scores) - 1))
        _add_method(figure, score, across, place)
    figure.add_scatter(
        x=[None],
        y=[None],
        mode="markers",
        name="bound of the same pictures",
        marker={"symbol": "line-ew", "size": 14, "line": {"color": NEUTRAL, "width": 3}},
    )
    ticks = list(comparison.options.lengths)
    figure.update_xaxes(
        title="length, mm", type="log", tickvals=ticks, ticktext=[f"{mm:g}" for mm in ticks]
    )
    figure.update_yaxes(title="rms error, mm", type="log", dtick=1)
    return figure


def _add_method(figure: go.Figure, score: MethodScore, across: float, place: int) -> None:
    colour = _COLOURS[place % len(_COLOURS)]
    x = (across * np.array([one.length_mm for one in score.lengths])).tolist()
    figure.add_scatter(
        x=x,
        y=[one.rms_mm for one in score.lengths],
        customdata=[
            (one.length_mm, one.bound_mm, 100.0 * one.bound_share) for one in score.lengths
        ],
        mode="lines+markers",
        name=score.name,
        legendgroup=score.name,
        line={"color": colour, "width": 1},
        marker={"color": colour, "size": 9, "symbol": _SYMBOLS[place % len(_SYMBOLS)]},
        hovertemplate="%{customdata[0]:g} mm: rms %{y:.4f} mm, bound %{customdata[1]:.4f} mm, "
        "%{customdata[2]:.0f} % of it reached",
    )
    figure.add_scatter(
        x=x,
        y=[one.bound_mm for one in score.lengths],
        mode="markers",
        showlegend=False,
        legendgroup=score.name,
        marker={"symbol": "line-ew", "size": 14, "line": {"color": colour, "width": 3}},
        hoverinfo="skip",
    )
