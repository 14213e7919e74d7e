"""Figures in space, to be turned with the mouse (plotly, three dimensions; mm, camera frame)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.calibration import Calibration, ViewResiduals
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.report.figures import NEUTRAL, joined, label, stage_colour, stages_of

_PATCH_MARGIN = 0.15
_FRUSTUM_SHARE = 0.2
_THINNEST_BOX = 0.25
_MOST_POINTS = 1500
_SHEET_COLOUR = "#e0453a"
_FAINT, _CLEAR = 0.3, 1.0
_GRID = 9
_EYE = np.array([-0.64, -0.43, -0.64])
_DISTANCE = 1.35
_HOVER = "X %{x:.2f}, Y %{y:.2f}, Z %{z:.2f} mm<extra></extra>"


def points_and_sheet(calibration: Calibration) -> go.Figure:
    """Markers, camera and sheet of light (the paper's Fig. 5)."""
    figure = go.Figure()
    views = calibration.residuals.views
    for stage in stages_of(views):
        _add_targets(figure, stage, [view for view in views if view.stage == stage])
    around = _near_sheet(calibration)
    markers = _finite(np.concatenate([*[view.xyz for view in views], around]))
    depth = float(np.median(markers[:, 2])) if len(markers) else 1.0
    camera = _add_camera(figure, calibration, _FRUSTUM_SHARE * depth)
    patches = [_add_sheet(figure, plane, around) for plane in calibration.light_planes]
    _look_at(figure, np.concatenate([markers, camera, *patches]))
    return figure


def reconstructed(calibration: Calibration, pieces: Sequence[LinePiece]) -> go.Figure:
    """Pieces of the laser line in space (the paper's Fig. 8)."""
    figure = go.Figure()
    clouds = [_finite(calibration.triangulate(_thinned(piece.uv))) for piece in pieces]
    for number, xyz in enumerate(clouds, start=1):
        figure.add_scatter3d(
            **_coordinates(xyz),
            mode="lines+markers",
            name=f"piece {number}",
            line={"width": 3},
            marker={"size": 2},
            hovertemplate=_HOVER,
        )
    points = np.concatenate([np.empty((0, 3)), *clouds])
    _look_at(figure, _add_sheet(figure, calibration.light_plane, points))
    return figure


def _add_targets(figure: go.Figure, stage: str, views: Sequence[ViewResiduals]) -> None:
    """Targets of one stage; those of the camera stage stay in the background."""
    xyz, names = joined([view.xyz for view in views], [view.view for view in views])
    background = stage == "camera"
    figure.add_scatter3d(
        **_coordinates(xyz),
        mode="lines+markers",
        name=f"{label(stage)} ({len(views)} views)",
        text=names,
        opacity=_FAINT if background else _CLEAR,
        line={"color": stage_colour(stage), "width": 2 if background else 4},
        marker={"color": stage_colour(stage), "size": 2 if background else 3},
        hovertemplate="%{text}<br>" + _HOVER,
    )


def _add_sheet(figure: go.Figure, plane: LightPlane, around: Array) -> Array:
    """A translucent rectangle of the sheet that holds the given points' feet on it.

    Returns its corners ``(4, 3)``, none where there are no points.
    """
    if not len(around):
        return np.empty((0, 3))
    corners = _patch(plane, around)
    figure.add_mesh3d(
        **_coordinates(corners),
        i=[0, 0],
        j=[1, 2],
        k=[2, 3],
        color=_SHEET_COLOUR,
        opacity=0.22,
        flatshading=True,
        lighting={"ambient": 1.0, "diffuse": 0.0, "specular": 0.0},
        name=label(plane.name),
        showlegend=True,
        hoverinfo="name",
    )
    return corners


def _patch(plane: LightPlane, around: Array) -> Array:
    """Corners ``(4, 3)`` of the rectangle, with a margin, along the points' main direction."""
    foot = around - np.outer(around @ plane.normal - plane.distance_mm, plane.normal)
    first, second = tangent_basis(plane.normal)
    flat = (foot - foot.mean(axis=0)) @ np.stack([first, second], axis=1)
    main = np.linalg.svd(flat, full_matrices=True)[2] if len(flat) > 1 else np.eye(2)
    turned = flat @ main.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    margin = _PATCH_MARGIN * float((high - low).max())
    low, high = low - margin, high + margin
    square = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    return foot.mean(axis=0) + square @ main @ np.stack([first, second])


def _near_sheet(calibration: Calibration) -> Array:
    """Points ``(N, 3)`` that show where the sheet is used: the markers placed in it, or,
    where there are none, what the camera sees of it nearer than five times its distance."""
    views = calibration.residuals.views
    nothing = np.empty((0, 3))
    placed = _finite(np.concatenate([nothing, *[v.xyz for v in views if v.stage != "camera"]]))
    if len(placed):
        return placed
    width, height = calibration.camera.image_size
    grid = np.meshgrid(np.linspace(0, width - 1, _GRID), np.linspace(0, height - 1, _GRID))
    seen = _finite(calibration.triangulate(np.stack(grid, axis=-1).reshape(-1, 2)))
    return seen[seen[:, 2] < 5.0 * calibration.light_plane.distance_mm]


def _add_camera(figure: go.Figure, calibration: Calibration, depth: float) -> Array:
    """The centre of projection and the pyramid of the picture's corners; returns all five."""
    width, height = calibration.camera.image_size
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]])
    rays = _finite(calibration.camera.unproject(corners.astype(float))) * depth
    centre = np.zeros((1, 3))
    gap = np.full((1, 3), np.nan)
    edges = [part for ray in rays for part in (centre, ray[None], gap)]
    frame = [rays, rays[:1]]
    figure.add_scatter3d(
        **_coordinates(np.concatenate([*edges, *frame])),
        mode="lines",
        name="camera",
        line={"color": NEUTRAL, "width": 3},
        hoverinfo="name",
    )
    return np.concatenate([centre, rays])


def _look_at(figure: go.Figure, points: Array) -> None:
    """Axes true to scale about the points, seen from behind the camera and above it, with Y
    pointing down as in the picture."""
    titles = {f"{axis}axis": {"title": {"text": f"{axis.upper()}, mm"}} for axis in "xyz"}
    figure.update_layout(scene={**titles, "camera": {"up": {"x": 0, "y": -1, "z": 0}}})
    if len(points):
        figure.update_layout(scene=_box(points))


def _box(points: Array) -> dict[str, object]:
    """Ranges that keep some room where the points span next to none, and an eye so far off
    that the whole box is seen."""
    low, high = points.min(axis=0), points.max(axis=0)
    largest = float((high - low).max()) or 1.0
    span = np.maximum(high - low, _THINNEST_BOX * largest) * 1.05
    middle = (low + high) / 2
    axes = {
        f"{axis}axis": {"range": [float(m - s / 2), float(m + s / 2)]}
        for axis, m, s in zip("xyz", middle, span, strict=True)
    }
    ratio = span / span.max()
    eye = _DISTANCE * float(np.linalg.norm(ratio)) * _EYE
    camera = {"eye": _named(eye), "center": {"x": 0, "y": 0.1, "z": 0}}
    return {**axes, "aspectmode": "manual", "aspectratio": _named(ratio), "camera": camera}


def _named(vector: Array) -> dict[str, float]:
    return dict(zip("xyz", map(float, vector), strict=True))


def _thinned(uv: Array) -> Array:
    """At most 1500 points of a piece, its ends among them."""
    if len(uv) <= _MOST_POINTS:
        return uv
    return uv[np.linspace(0, len(uv) - 1, _MOST_POINTS).round().astype(int)]


def _finite(points: Array) -> Array:
    return points[np.isfinite(points).all(axis=1)]


def _coordinates(xyz: Array) -> dict[str, np.ndarray]:
    """Seven digits are enough for the eye, and halve the page."""
    single = xyz.astype(np.float32)
    return {"x": single[:, 0], "y": single[:, 1], "z": single[:, 2]}
