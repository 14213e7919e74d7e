"""Views that cannot be pictures of a straight target, found before anything is computed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.io.quoting import one_line
from sheetoflight.model.observations import TargetViews

OFF_LINE_LIMIT = 0.10
"""Farthest a marker may lie off the line of the others, as a part of the target's image length.
A lens of 70° with k1 = −0.3 bends a target along the edge of the picture by 7 % of its length."""

NOISE_FLOOR_PX = 5.0
"""Where a target is seen almost end on, noise alone puts its markers out of line and order;
five times the noise of a poor detector is more than chance."""


def check_target_views(views: TargetViews, stage: str, image_size: tuple[int, int]) -> None:
    """Refuse views in which the markers cannot be where they are said to be.

    Parameters
    ----------
    views : TargetViews
    stage : str
        The views' stage, for messages.
    image_size : (int, int)
        Width and height in px.

    Raises
    ------
    InputError
        For the first view with a marker outside the picture, markers out of order along their
        image line, a marker far off the line of the others, or the points of an earlier view;
        view and marker are named.
    """
    checks: tuple[Callable[[Array, np.ndarray], tuple[str, str] | None], ...] = (
        lambda uv, markers: _outside(uv, markers, image_size),
        _out_of_order,
        _off_line,
    )
    for name, uv, seen in zip(views.names, views.uv, views.seen, strict=True):
        for check in checks:
            problem = check(uv[seen], np.flatnonzero(seen))
            if problem:
                what, remedy = problem
                raise InputError(f"stage {stage}, view {one_line(name)}: {what}", remedy)
    _refuse_copies(views, stage)


def _outside(uv: Array, markers: np.ndarray, image_size: tuple[int, int]) -> tuple[str, str] | None:
    width, height = image_size
    within = (uv >= -0.5) & (uv <= np.array([width, height]) - 0.5)
    outside = np.flatnonzero(~within.all(axis=1))
    if not outside.size:
        return None
    u, v = uv[outside[0]]
    return (
        f"marker {markers[outside[0]]} at ({u:.6g}, {v:.6g}) lies outside the picture of "
        f"{width} × {height} px",
        "check the point, and image_size in rig.toml",
    )


def _out_of_order(uv: Array, markers: np.ndarray) -> tuple[str, str] | None:
    if len(uv) < 3:
        return None
    centre, direction = fitted_line(uv)
    steps = np.diff((uv - centre) @ direction)
    backward = np.flatnonzero(steps < -NOISE_FLOOR_PX)
    if not backward.size:
        return None
    first = backward[0]
    return (
        f"marker {markers[first + 1]} lies {-steps[first]:.1f} px before marker "
        f"{markers[first]} along the line from marker {markers[0]} to marker {markers[-1]}",
        "check the order of the markers, or remove the view",
    )


def _off_line(uv: Array, markers: np.ndarray) -> tuple[str, str] | None:
    if len(uv) < 3:
        return None
    length = float(np.linalg.norm(uv[:, None] - uv[None, :], axis=-1).max())
    limit = max(OFF_LINE_LIMIT * length, NOISE_FLOOR_PX)
    worst, distance = _farthest_off(uv)
    if distance <= limit:
        return None
    return (
        f"marker {markers[worst]} lies {distance:.1f} px off the line of the others "
        f"(limit {limit:.1f})",
        "check the point and the order of the markers, or remove the view",
    )


def _farthest_off(uv: Array) -> tuple[int, float]:
    """The marker whose removal leaves the straightest rest, and its distance from that line.

    Any two points are straight: of three markers it is the one nearest to the others' line.
    """
    straightness, distances = np.empty(len(uv)), np.empty(len(uv))
    for index in range(len(uv)):
        others = np.delete(uv, index, axis=0)
        centre, direction = fitted_line(others)
        across = np.array([-direction[1], direction[0]])
        distances[index] = abs((uv[index] - centre) @ across)
        straightness[index] = np.abs((others - centre) @ across).max()
    worst = int(np.argmin(distances if len(uv) == 3 else straightness))
    return worst, float(distances[worst])


def _refuse_copies(views: TargetViews, stage: str) -> None:
    first: dict[bytes, str] = {}
    for name, uv, seen in zip(views.names, views.uv, views.seen, strict=True):
        if not seen.any():
            continue
        points = np.where(seen[:, None], uv, np.nan).tobytes()
        if points in first:
            raise InputError(
                f"stage {stage}: view {one_line(name)} repeats view {one_line(first[points])} "
                "exactly; a copied picture adds no information",
                "remove one of the two",
            )
        first[points] = name
