"""Figures of a verification (plotly, two dimensions)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sheetoflight.measurement.comparison import Comparison
from sheetoflight.measurement.verification import Verification
from sheetoflight.report.figures import NEUTRAL, frame_of_picture, label

PASSED_COLOUR, FAILED_COLOUR, NOT_JUDGED_COLOUR = "#1f9d78", "#d9622b", "#8a7fb8"
_FAILED_SYMBOL = "x"
_BAND_POINTS = 50
_MARGIN = 0.08


def errors_over_length(verification: Verification) -> go.Figure:
    """Errors with their 95 % bars over the known length, and the band of the limit."""
    figure = go.Figure()
    lengths = np.array([one.known.value for one in verification.comparisons])
    reach = _MARGIN * max(float(np.ptp(lengths)), 0.1 * float(lengths.max()))
    across = np.linspace(lengths.min() - reach, lengths.max() + reach, _BAND_POINTS)
    if verification.limit:
        limits = np.array([verification.limit.at(length) for length in across])
        _add_band(figure, across, limits, "maximum permissible error")
    statistics = verification.statistics
    constant = 0.0 if statistics.offset is None else statistics.offset.value
    figure.add_scatter(
        x=across,
        y=constant + statistics.scale.value * across / 1000.0,
        mode="lines",
        name=f"trend, {statistics.scale.value:+.3g} mm/m",
        line={"color": NEUTRAL, "width": 1.5, "dash": "dash"},
        hoverinfo="skip",
    )
    for name, colour, symbol, group in _groups(verification):
        figure.add_scatter(
            x=[one.known.value for one in group],
            y=[one.error for one in group],
            error_y={"array": [one.expanded for one in group], "thickness": 1.2, "width": 3},
            mode="markers",
            name=name,
            text=[label(one.segment.name) for one in group],
            marker={"color": colour, "size": 8, "symbol": symbol},
            hovertemplate="%{text}<br>%{x:.3f} mm, error %{y:.4f} mm<extra></extra>",
        )
    figure.update_xaxes(title="known length, mm", zeroline=False)
    figure.update_yaxes(title="measured − known, mm", zeroline=True)
    return figure


def normalised_errors(verification: Verification) -> go.Figure:
    """E_n of every segment in the order of measuring, with the lines at ±1."""
    figure = go.Figure()
    place = {id(one): number for number, one in enumerate(verification.comparisons, start=1)}
    _add_band(
        figure,
        np.array([0.5, len(place) + 0.5]),
        np.ones(2),
        "explained by the stated uncertainties",
    )
    for name, colour, symbol, group in _groups(verification):
        known = [one for one in group if one.normalised_error is not None]
        figure.add_scatter(
            x=[place[id(one)] for one in known],
            y=[one.normalised_error for one in known],
            mode="markers",
            name=name,
            text=[label(one.segment.name) for one in known],
            marker={"color": colour, "size": 8, "symbol": symbol},
            hovertemplate="%{text}<br>E_n %{y:.2f}<extra></extra>",
        )
    figure.update_xaxes(title="segment, in the order of measuring", showgrid=False)
    figure.update_yaxes(title="E_n", zeroline=True)
    return figure


def segments_in_picture(verification: Verification) -> go.Figure:
    """Where the segments were seen, in the picture's frame."""
    figure = go.Figure()
    groups = [(name, colour, [one.segment for one in group])
              for name, colour, _, group in _groups(verification)]  # fmt: skip
    if verification.not_judged:
        groups.append(("not judged", NOT_JUDGED_COLOUR, list(verification.not_judged)))
    for name, colour, segments in groups:
        gap = np.full((1, 2), np.nan)
        uv = np.concatenate([np.concatenate([segment.ends, gap]) for segment in segments])
        figure.add_scatter(
            x=uv[:, 0],
            y=uv[:, 1],
            mode="lines+markers",
            name=name,
            text=[label(segment.name) for segment in segments for _ in range(3)],
            line={"color": colour, "width": 1.5},
            marker={"color": colour, "size": 5},
            hovertemplate="%{text}<br>u %{x:.1f}, v %{y:.1f} px<extra></extra>",
        )
    frame_of_picture(figure, verification.image_size)
    return figure


def _groups(
    verification: Verification,
) -> list[tuple[str, str, str, Sequence[Comparison]]]:
    """Name, colour, symbol and members of those that passed and of those that failed."""
    passed = [one for one in verification.comparisons if one.passed]
    both = [
        ("passed", PASSED_COLOUR, "circle", passed),
        ("failed", FAILED_COLOUR, _FAILED_SYMBOL, verification.failed),
    ]
    return [group for group in both if group[3]]


def _add_band(figure: go.Figure, x: np.ndarray, half_width: np.ndarray, name: str) -> None:
    figure.add_scatter(
        x=np.concatenate([x, x[::-1]]),
        y=np.concatenate([half_width, -half_width[::-1]]),
        mode="lines",
        fill="toself",
        fillcolor="rgba(31, 157, 120, 0.12)",
        line={"color": NEUTRAL, "width": 1},
        name=name,
        hoverinfo="skip",
    )
