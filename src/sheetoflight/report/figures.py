"""Figures in the picture's own coordinates, and residuals (plotly, two dimensions)."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.report.board_outlines import outline
from sheetoflight.report.numbers import two_digits
from sheetoflight.report.point_groups import PointGroup, point_groups, stages_of

STAGE_COLOURS = {
    "camera": "#3b82c4",
    "plane": "#d9622b",
    "crossing": "#c98a00",
    "board": "#1f9d78",
}
OTHER_COLOUR = "#8a7fb8"
SHEET_COLOURS = ("#e0453a", "#3f8f3f", "#8e5bd0", "#0f8aa8")
NEUTRAL = "#808890"

_ARROW_SHARE = 0.03
_SPACING_SHARE = 0.6
_IMAGE_DOTS = {"markers": 5, "spots": 8, "board": 3}
_RESIDUAL_DOTS = {"markers": 5, "spots": 5, "board": 3}
_OUTLINE_OPACITY = 0.6
_SHAFTS = {"markers": 1.3, "spots": 1.3, "board": 0.8}
_OVERVIEW_MARGIN = 0.05


def stage_colour(stage: str) -> str:
    """One colour for a stage in all figures."""
    return STAGE_COLOURS.get(stage, OTHER_COLOUR)


def sheet_colour(laser: int) -> str:
    """One colour for a sheet of light in all figures."""
    return SHEET_COLOURS[laser % len(SHEET_COLOURS)]


def group_colour(group: PointGroup) -> str:
    """Targets have the colour of their stage, spots and the targets in further sheets that of
    their sheet."""
    if group.laser is None or (group.laser == 0 and group.kind == "markers"):
        return stage_colour(group.stage)
    return sheet_colour(group.laser)


def label(text: str) -> str:
    """Text that plotly shows letter by letter: it reads some HTML tags otherwise."""
    return html.escape(text)


def image_points(calibration: Calibration) -> go.Figure:
    """Image points of markers, spots and boards of every view, in the picture's frame (the
    paper's Fig. 4)."""
    figure = go.Figure()
    for group in point_groups(calibration):
        if group.kind == "board":
            _add_outlines(figure, group)
        uv, names = joined(group.uv, group.views)
        colour = group_colour(group)
        figure.add_scatter(
            x=uv[:, 0],
            y=uv[:, 1],
            mode="lines+markers" if group.kind == "markers" else "markers",
            name=counted(group),
            legendgroup=label(group.title),
            text=names,
            line={"color": colour, "width": 0.8},
            marker={"color": colour, "size": _IMAGE_DOTS[group.kind], "symbol": symbol(group)},
            hovertemplate="%{text}<br>u %{x:.2f}, v %{y:.2f} px<extra></extra>",
        )
    figure.update_layout(legend={"itemsizing": "constant"})
    frame_of_picture(figure, calibration.camera.image_size)
    return figure


def _add_outlines(figure: go.Figure, group: PointGroup) -> None:
    """The outline of the board in every view, as one trace."""
    uv, _ = joined([points[outline(points)] for points in group.uv], group.views)
    figure.add_scatter(
        x=uv[:, 0],
        y=uv[:, 1],
        mode="lines",
        showlegend=False,
        legendgroup=label(group.title),
        line={"color": group_colour(group), "width": 1},
        opacity=_OUTLINE_OPACITY,
        hoverinfo="skip",
    )


def counted(group: PointGroup) -> str:
    """A group's title with the number of its views, for a legend."""
    return f"{label(group.title)} ({len(group)} {'view' if len(group) == 1 else 'views'})"


def symbol(group: PointGroup) -> str:
    """Spots are crosses in all figures, markers dots."""
    return "x" if group.kind == "spots" else "circle"


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
    figure, groups = go.Figure(), point_groups(calibration)
    room = _room_of_arrows(groups, calibration.camera.image_size)
    factor = round_factor(room, calibration.residuals.rms_px)
    for group in groups:
        uv, residuals = np.concatenate(group.uv), np.concatenate(group.residuals)
        seen = np.isfinite(uv).all(axis=1) & np.isfinite(residuals).all(axis=1)
        uv, tips = uv[seen], uv[seen] + factor * residuals[seen]
        shafts = np.stack([uv, tips, np.full_like(uv, np.nan)], axis=1).reshape(-1, 2)
        colour = group_colour(group)
        figure.add_scatter(
            x=shafts[:, 0],
            y=shafts[:, 1],
            mode="lines",
            name=label(group.title),
            legendgroup=label(group.title),
            line={"color": colour, "width": _SHAFTS[group.kind]},
            hoverinfo="skip",
        )
        figure.add_scatter(
            x=uv[:, 0],
            y=uv[:, 1],
            mode="markers",
            showlegend=False,
            legendgroup=label(group.title),
            marker={"color": colour, "size": _RESIDUAL_DOTS[group.kind], "symbol": symbol(group)},
            customdata=residuals[seen],
            hovertemplate="du %{customdata[0]:.3g}, dv %{customdata[1]:.3g} px<extra></extra>",
        )
    frame_of_picture(figure, calibration.camera.image_size)
    figure.update_xaxes(title=f"u, px – residuals enlarged {factor:g} times")
    return figure


def _room_of_arrows(groups: Sequence[PointGroup], image_size: tuple[int, int]) -> float:
    """How long an arrow of usual size may be, px: a share of the picture's width, and less where
    points stand so densely that arrows would cover one another."""
    width, height = image_size
    spacing = math.sqrt(width * height / max(sum(group.seen for group in groups), 1))
    return min(_ARROW_SHARE * width, _SPACING_SHARE * spacing)


def residual_scatter(calibration: Calibration) -> go.Figure:
    """Both components of every residual, with circles at 1, 2 and 3 times the noise."""
    figure = go.Figure()
    for group in point_groups(calibration):
        points, names = joined(group.residuals, group.views)
        colour = group_colour(group)
        figure.add_scatter(
            x=points[:, 0],
            y=points[:, 1],
            mode="markers",
            name=label(group.title),
            text=names,
            marker={
                "color": colour,
                "size": _RESIDUAL_DOTS[group.kind],
                "opacity": 0.75,
                "symbol": symbol(group),
            },
            hovertemplate="%{text}<br>du %{x:.3g}, dv %{y:.3g} px<extra></extra>",
        )
    for multiple in (1, 2, 3):
        radius = multiple * calibration.pixel_std
        figure.add_shape(
            type="circle",
            layer="above",
            x0=-radius,
            y0=-radius,
            x1=radius,
            y1=radius,
            line={"color": NEUTRAL, "width": 1, "dash": "dot"},
        )
    residuals = [view.residuals for view in calibration.residuals.views]
    reach = _reach(residuals, calibration.pixel_std)
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


def frame_of_picture(figure: go.Figure, image_size: tuple[int, int]) -> None:
    """Axes u and v in px, v down, with square pixels and the picture's outline."""
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
