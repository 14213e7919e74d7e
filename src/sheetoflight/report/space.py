"""Figures in space, to be turned with the mouse (plotly, three dimensions; mm, camera frame)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.measurement.triangulation import triangulate
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.report.board_outlines import outline
from sheetoflight.report.figures import (
    NEUTRAL,
    counted,
    group_colour,
    joined,
    label,
    sheet_colour,
    symbol,
)
from sheetoflight.report.point_groups import PointGroup, in_sheet, point_groups

_PATCH_MARGIN = 0.15
_FRUSTUM_SHARE = 0.2
_THINNEST_BOX = 0.25
_MOST_POINTS = 1500
_FAINT, _CLEAR = 0.3, 1.0
_FEW_BOARDS = 20
_GRID = 9
_TWO = np.array([[0, 1, 2], [0, 2, 3]])
_EYE = np.array([-0.64, -0.43, -0.64])
_DISTANCE = 1.35
_HOVER = "X %{x:.2f}, Y %{y:.2f}, Z %{z:.2f} mm<extra></extra>"


def points_and_sheets(calibration: Calibration) -> go.Figure:
    """Targets, spots, camera and every sheet of light (the paper's Fig. 5)."""
    figure = go.Figure()
    groups = point_groups(calibration)
    for group in groups:
        if group.kind == "board":
            _add_boards(figure, group)
        else:
            _add_points(figure, group)
    lasers = range(len(calibration.light_planes))
    around = [_near_sheet(calibration, laser) for laser in lasers]
    seen = [part for group in groups for part in group.xyz]
    points = _finite(np.concatenate([*seen, *around]))
    depth = float(np.median(points[:, 2])) if len(points) else 1.0
    camera = _add_camera(figure, calibration, _FRUSTUM_SHARE * depth)
    patches = [_add_sheet(figure, calibration, laser, around[laser]) for laser in lasers]
    _look_at(figure, np.concatenate([points, camera, *patches]))
    return figure


def reconstructed(
    calibration: Calibration,
    pieces: Sequence[LinePiece],
    names: Sequence[str],
    laser: str | None = None,
) -> go.Figure:
    """Named pieces of the laser line in space (the paper's Fig. 8)."""
    figure = go.Figure()
    clouds = [_finite(triangulate(calibration, _thinned(piece.uv), laser)) for piece in pieces]
    for name, xyz in zip(names, clouds, strict=True):
        figure.add_scatter3d(
            **_coordinates(xyz),
            mode="lines+markers",
            name=label(name),
            line={"width": 3},
            marker={"size": 2},
            hovertemplate=_HOVER,
        )
    points = np.concatenate([np.empty((0, 3)), *clouds])
    number = calibration.light_planes.index(calibration.sheet(laser))
    _look_at(figure, _add_sheet(figure, calibration, number, points))
    return figure


def _add_points(figure: go.Figure, group: PointGroup) -> None:
    """Points of one group; targets of the camera stage stay in the background."""
    xyz, names = joined(group.xyz, group.views)
    background, spots = group.stage == "camera", group.kind == "spots"
    colour = group_colour(group)
    figure.add_scatter3d(
        **_coordinates(xyz),
        mode="markers" if spots else "lines+markers",
        name=counted(group),
        text=names,
        opacity=_FAINT if background else _CLEAR,
        line={"color": colour, "width": 2 if background else 4},
        marker={"color": colour, "size": 2 if background else 4, "symbol": symbol(group)},
        hovertemplate="%{text}<br>" + _HOVER,
    )


def _add_boards(figure: go.Figure, group: PointGroup) -> None:
    """The outline of the board in every view, and its points, faint, under the same name."""
    colour = group_colour(group)
    rings = [xyz[outline(uv)] for uv, xyz in zip(group.uv, group.xyz, strict=True)]
    lines, names = joined(rings, group.views)
    figure.add_scatter3d(
        **_coordinates(lines),
        mode="lines",
        name=counted(group),
        legendgroup=label(group.title),
        text=names,
        line={"color": colour, "width": 3 if len(group) <= _FEW_BOARDS else 1},
        hovertemplate="%{text}<extra></extra>",
    )
    points, names = joined(group.xyz, group.views)
    figure.add_scatter3d(
        **_coordinates(points),
        mode="markers",
        showlegend=False,
        legendgroup=label(group.title),
        text=names,
        opacity=_FAINT,
        marker={"color": colour, "size": 1.5},
        hovertemplate="%{text}<br>" + _HOVER,
    )


def _add_sheet(figure: go.Figure, calibration: Calibration, laser: int, around: Array) -> Array:
    """A translucent rectangle of the sheet that holds the given points' feet on it.

    Returns its corners ``(4, 3)``, of a curved sheet its nodes, none where there are no points.
    """
    if not len(around):
        return np.empty((0, 3))
    plane = calibration.light_planes[laser]
    corners = _patch(plane, around)
    nodes, triangles = (corners, _TWO) if plane.curvature is None else _bent(plane, corners)
    figure.add_mesh3d(
        **_coordinates(nodes),
        **dict(zip("ijk", np.transpose(triangles).tolist(), strict=True)),
        color=sheet_colour(laser),
        opacity=0.22,
        flatshading=True,
        lighting={"ambient": 1.0, "diffuse": 0.0, "specular": 0.0},
        name=label(f"sheet {plane.name}" if len(calibration.light_planes) > 1 else plane.name),
        showlegend=True,
        hoverinfo="name",
    )
    return nodes


def _bent(plane: LightPlane, corners: Array) -> tuple[Array, np.ndarray]:
    """Nodes ``(N, 3)`` of a curved sheet over a rectangle of its plane, and its triangles
    ``(T, 3)``."""
    share = np.linspace(0.0, 1.0, _GRID)[:, None]
    sides = [first + share * (last - first) for first, last in (corners[:2], corners[3:1:-1])]
    flat = sides[0][:, None] + share * (sides[1] - sides[0])[:, None]
    flat = flat.reshape(-1, 3)
    assert plane.curvature is not None
    nodes = flat + plane.curvature.heights(flat)[:, None] * plane.normal
    row, column = np.divmod(np.arange(_GRID * (_GRID - 1)), _GRID)
    first = np.arange(len(row))[column < _GRID - 1]
    upper = np.stack([first, first + 1, first + _GRID + 1], axis=1)
    lower = np.stack([first, first + _GRID + 1, first + _GRID], axis=1)
    return nodes, np.concatenate([upper, lower])


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


def _near_sheet(calibration: Calibration, laser: int) -> Array:
    """Points ``(N, 3)`` that show where a sheet is used: the markers and spots in it, or,
    where there are none, what the camera sees of it nearer than five times its distance."""
    placed = in_sheet(calibration, laser)
    if len(placed):
        return placed
    plane = calibration.light_planes[laser]
    width, height = calibration.camera.image_size
    grid = np.meshgrid(np.linspace(0, width - 1, _GRID), np.linspace(0, height - 1, _GRID))
    pixels = np.stack(grid, axis=-1).reshape(-1, 2)
    seen = _finite(triangulate(calibration, pixels, plane.name))
    return seen[seen[:, 2] < 5.0 * plane.distance_mm]


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
