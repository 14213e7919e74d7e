"""Figures in the picture's own coordinates, and residuals (plotly, two dimensions)."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration, ViewResiduals
from sheetoflight.report.numbers import two_digits

STAGE_COLOURS = {
    "camera": "#3b82c4",
    "plane": "#d9622b",
    "crossing": "#c98a00",
    "board": "#1f9d78",
}
OTHER_COLOUR = "#8a7fb8"
NEUTRAL = "#808890"

_ARROW_SHARE = 0.03
_OVERVIEW_MARGIN = 0.05


def stage_colour(stage: str) -> str:
    """One colour for a stage in all figures."""
    return STAGE_COLOURS.get(stage, OTHER_COLOUR)


def stages_of(views: Sequence[ViewResiduals]) -> tuple[str, ...]:
    """The stages that occur, in the order of their first view."""
    return tuple(dict.fromkeys(view.stage for view in views))


def label(text: str) -> str:
    """Text that plotly shows letter by letter: it reads some HTML tags otherwise."""
    return html.escape(text)


def image_points(calibration: Calibration) -> go.Figure:
    """Image points of the markers of every view, in the picture's frame (the paper's Fig. 4)."""
    figure = go.Figure()
    views = calibration.residuals.views
    for stage in stages_of(views):
        of_stage = [view for view in views if view.stage == stage]
        uv, names = joined([v.uv for v in of_stage], [v.view for v in of_stage])
        figure.add_scatter(
            x=uv[:, 0],
            y=uv[:, 1],
            mode="lines+markers",
            name=f"{label(stage)} ({len(of_stage)} views)",
            text=names,
            line={"color": stage_colour(stage), "width": 0.8},
            marker={"color": stage_colour(stage), "size": 5},
            hovertemplate="%{text}<br>u %{x:.2f}, v %{y:.2f} px<extra></extra>",
        )
    _frame_of_picture(figure, calibration.camera.image_size)
    return figure


def residual_bars(calibration: Calibration) -> go.Figure:
    """Root mean square residual of every view, stage by stage."""
    figure = go.Figure()
    views = calibration.residuals.views
    for stage in stages_of(views):
        numbers = [i for i, view in enumerate(views) if view.stage == stage]
        figure.add_bar(
            x=[number + 1 for number in numbers],
            y=[views[number].rms_px for number in numbers],
            name=label(stage),
            marker={"color": stage_colour(stage)},
            hovertext=[label(views[number].view) for number in numbers],
            hovertemplate="%{hovertext}<br>%{y:.3g} px<extra></extra>",
        )
    figure.add_scatter(
        x=[0.5, len(views) + 0.5],
        y=[calibration.residuals.rms_px] * 2,
        mode="lines",
        name=f"all: {two_digits(calibration.residuals.rms_px)} px",
        line={"color": NEUTRAL, "width": 1.5, "dash": "dash"},
        hoverinfo="skip",
    )
    figure.update_xaxes(title="view, in the order of the calibration", showgrid=False)
    figure.update_yaxes(title="rms residual, px", rangemode="tozero")
    return figure


def residual_arrows(calibration: Calibration) -> go.Figure:
    """Residuals as arrows over the picture, enlarged by a round factor that is stated."""
    views = calibration.residuals.views
    width = calibration.camera.image_size[0]
    factor = round_factor(_ARROW_SHARE * width, calibration.residuals.rms_px)
    figure = go.Figure()
    for stage in stages_of(views):
        uv = np.concatenate([view.uv for view in views if view.stage == stage])
        residuals = np.concatenate([view.residuals for view in views if view.stage == stage])
        seen = np.isfinite(uv).all(axis=1) & np.isfinite(residuals).all(axis=1)
        uv, tips = uv[seen], uv[seen] + factor * residuals[seen]
        shafts = np.stack([uv, tips, np.full_like(uv, np.nan)], axis=1).reshape(-1, 2)
        figure.add_scatter(
            x=shafts[:, 0],
            y=shafts[:, 1],
            mode="lines",
            name=label(stage),
            legendgroup=stage,
            line={"color": stage_colour(stage), "width": 1.3},
            hoverinfo="skip",
        )
        figure.add_scatter(
            x=uv[:, 0],
            y=uv[:, 1],
            mode="markers",
            showlegend=False,
            legendgroup=stage,
            marker={"color": stage_colour(stage), "size": 4},
            customdata=residuals[seen],
            hovertemplate="du %{customdata[0]:.3g}, dv %{customdata[1]:.3g} px<extra></extra>",
        )
    _frame_of_picture(figure, calibration.camera.image_size)
    figure.update_xaxes(title=f"u, px – residuals enlarged {factor:g} times")
    return figure


def residual_scatter(calibration: Calibration) -> go.Figure:
    """Both components of every residual, with circles at 1, 2 and 3 times the noise."""
    figure = go.Figure()
    views = calibration.residuals.views
    for stage in stages_of(views):
        of_stage = [view for view in views if view.stage == stage]
        points, names = joined([v.residuals for v in of_stage], [v.view for v in of_stage])
        figure.add_scatter(
            x=points[:, 0],
            y=points[:, 1],
            mode="markers",
            name=label(stage),
            text=names,
            marker={"color": stage_colour(stage), "size": 5, "opacity": 0.75},
            hovertemplate="%{text}<br>du %{x:.3g}, dv %{y:.3g} px<extra></extra>",
        )
    for multiple in (1, 2, 3):
        radius = multiple * calibration.pixel_std
        figure.add_shape(
            type="circle",
            x0=-radius,
            y0=-radius,
            x1=radius,
            y1=radius,
            line={"color": NEUTRAL, "width": 1, "dash": "dot"},
        )
    reach = _reach([view.residuals for view in views], calibration.pixel_std)
    figure.update_xaxes(title="du, px", zeroline=True, range=[-reach, reach])
    figure.update_yaxes(title="dv, px", zeroline=True, range=[reach, -reach])
    _equal_scales(figure)
    return figure


def joined(groups: Sequence[Array], names: Sequence[str]) -> tuple[Array, list[str]]:
    """Points of many views as one array with a NaN row after each view, and a name each row.

    Unseen points are dropped, so that a line joins the neighbours of a missing marker.
    """
    width = groups[0].shape[1]
    rows: list[Array] = []
    texts: list[str] = []
    for points, name in zip(groups, names, strict=True):
        seen = points[np.isfinite(points).all(axis=1)]
        rows += [seen, np.full((1, width), np.nan)]
        texts += [label(name)] * (len(seen) + 1)
    return np.concatenate(rows), texts


def _frame_of_picture(figure: go.Figure, image_size: tuple[int, int]) -> None:
    width, height = image_size
    margin = _OVERVIEW_MARGIN * max(width, height)
    figure.add_shape(
        type="rect",
        x0=-0.5,
        y0=-0.5,
        x1=width - 0.5,
        y1=height - 0.5,
        line={"color": NEUTRAL, "width": 1},
    )
    figure.update_xaxes(title="u, px", range=[-margin, width + margin], zeroline=False)
    figure.update_yaxes(title="v, px", range=[height + margin, -margin], zeroline=False)
    _equal_scales(figure)


def _equal_scales(figure: go.Figure) -> None:
    """One unit as long along u as along v, by shrinking the axes rather than widening them."""
    figure.update_xaxes(constrain="domain")
    figure.update_yaxes(scaleanchor="x", scaleratio=1, constrain="domain")


def _reach(residuals: Sequence[Array], pixel_std: float) -> float:
    """Half the width that shows every residual and all three circles."""
    largest = max((float(np.abs(r[np.isfinite(r)]).max(initial=0.0)) for r in residuals), default=0)
    return 1.1 * max(largest, 3.0 * pixel_std)


def round_factor(length: float, residual: float) -> float:
    """The largest of 1, 2, 5, 10 … that draws the residual no longer than the given length."""
    if residual <= 0:
        return 1.0
    exponent = math.floor(math.log10(length / residual))
    leading = length / residual / 10.0**exponent
    return max((step for step in (2.0, 5.0) if step <= leading), default=1.0) * 10.0**exponent
