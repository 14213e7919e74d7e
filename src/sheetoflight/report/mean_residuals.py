"""Residuals of very many points: their means over squares of the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.report.figures import (
    NEUTRAL,
    frame_of_picture,
    round_factor,
    stage_colour,
)
from sheetoflight.report.point_groups import point_groups

_SQUARES_ACROSS = 12
_FEWEST_POINTS = 8
_ARROW_SHARE = 0.3
_REACH = math.sqrt(-2.0 * math.log(0.05))
"""Within so many standard deviations of a coordinate lie 95 % of normal errors in the plane."""

_CORNERS_OF_CIRCLE = 24


@dataclass(frozen=True)
class MeanResiduals:
    """Means of residuals over the squares that hold eight points or more.

    Parameters
    ----------
    side_px : float
        Of the squares.
    uv : (S, 2) array
        Middle of each square's points, px.
    residuals : (S, 2) array
        Their mean residual, px.
    counts : (S,) int array
        Their number.
    std_px : float
        Root mean square of a coordinate of all residuals.
    """

    side_px: float
    uv: Array
    residuals: Array
    counts: np.ndarray
    std_px: float

    @property
    def reach_px(self) -> Array:
        """``(S,)``: within what distance of zero independent noise leaves 95 % of such means."""
        return _REACH * self.std_px / np.sqrt(self.counts)


def mean_residuals(calibration: Calibration) -> MeanResiduals:
    """The means of the boards' residuals."""
    boards = [group for group in point_groups(calibration) if group.kind == "board"]
    uv = np.concatenate([np.empty((0, 2)), *(part for group in boards for part in group.uv)])
    residuals = np.concatenate([uv[:0], *(part for one in boards for part in one.residuals)])
    seen = np.isfinite(uv).all(axis=1) & np.isfinite(residuals).all(axis=1)
    uv, residuals = uv[seen], residuals[seen]
    side = max(calibration.camera.image_size) / _SQUARES_ACROSS
    squares = (uv + 0.5) // side
    _, own, counts = np.unique(squares, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 4))
    np.add.at(sums, own.ravel(), np.concatenate([uv, residuals], axis=1))
    full = counts >= _FEWEST_POINTS
    means = sums[full] / counts[full, None]
    std = float(np.sqrt(np.mean(residuals**2))) if len(residuals) else 0.0
    return MeanResiduals(side, means[:, :2], means[:, 2:], counts[full], std)


def residual_means(calibration: Calibration) -> go.Figure:
    """Mean residuals as arrows over the picture, with the circles that noise alone would fill."""
    found = mean_residuals(calibration)
    longest = np.maximum(np.linalg.norm(found.residuals, axis=1), found.reach_px)
    usual = float(np.median(longest)) if len(longest) else 0.0
    factor = round_factor(_ARROW_SHARE * found.side_px, usual)
    figure, colour = go.Figure(), stage_colour("board")
    circles = _circles(found.uv, factor * found.reach_px)
    figure.add_scatter(
        x=circles[:, 0],
        y=circles[:, 1],
        mode="lines",
        name="95 % of noise alone",
        line={"color": NEUTRAL, "width": 1},
        hoverinfo="skip",
    )
    gaps = np.full_like(found.uv, np.nan)
    shafts = np.stack([found.uv, found.uv + factor * found.residuals, gaps], axis=1).reshape(-1, 2)
    figure.add_scatter(
        x=shafts[:, 0],
        y=shafts[:, 1],
        mode="lines",
        name="mean residual of a square",
        line={"color": colour, "width": 2},
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=found.uv[:, 0],
        y=found.uv[:, 1],
        mode="markers",
        showlegend=False,
        marker={"color": colour, "size": 4},
        customdata=np.column_stack([found.residuals, found.counts]),
        hovertemplate="%{customdata[2]} points: mean du %{customdata[0]:.2g}, "
        "dv %{customdata[1]:.2g} px<extra></extra>",
    )
    frame_of_picture(figure, calibration.camera.image_size)
    figure.update_xaxes(title=f"u, px – residuals enlarged {factor:g} times")
    return figure


def _circles(middles: Array, radii: Array) -> Array:
    """Closed polygons about the middles ``(S, 2)``, a NaN row after each."""
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS_OF_CIRCLE + 1)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings = middles[:, None] + radii[:, None, None] * around
    gaps = np.full((len(rings), 1, 2), np.nan)
    return np.concatenate([rings, gaps], axis=1).reshape(-1, 2)
