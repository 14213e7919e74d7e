"""Lengths across the part of the picture in which the sheet of light was seen on targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board import Board
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations

_PLACES = 3
_HALVINGS = 12
_ENOUGH = 0.5
_TANGENT_PX = 0.5
DIRECTIONS = ("u", "v")


@dataclass(frozen=True)
class FieldSegment:
    """A segment in a sheet of light whose ends have fixed image points.

    Parameters
    ----------
    name : str
        Length, direction and middle in words.
    laser : str
        In whose sheet it lies.
    uv : (2, 2) array
        Image points of its ends, px.
    """

    name: str
    laser: str
    uv: Array


def field_segments(
    calibration: Calibration, observations: Observations, board: Board | None = None
) -> tuple[FieldSegment, ...]:
    """Segments of the target's length at 3 × 3 places, along u and along v.

    The places divide, for each laser, the part of the picture in which the target's markers lay
    in the sheet, or the sheet crossed a target or a board. The length is the target's, or that of
    the board's longest side where there is no target. Segments that leave the picture are left
    out; where fewer than half would remain, all are taken half as long.

    Parameters
    ----------
    calibration : Calibration
        With the target that gave the scale, if any.
    observations : Observations
        What it was calibrated from.
    board : Board, optional
        What stage board shows.
    """
    longest = _longest(calibration, board)
    if longest is None:
        return ()
    found: list[FieldSegment] = []
    for number, plane in enumerate(calibration.light_planes):
        seen = _seen_in_sheet(observations, number, len(calibration.light_planes))
        if len(seen):
            found += _segments(calibration, plane.name, _grid(seen), longest)
    return tuple(found)


def _longest(calibration: Calibration, board: Board | None) -> float | None:
    """Length of the target or else of the board, mm."""
    if calibration.target is not None:
        return calibration.target.length_mm
    return None if board is None else float(np.ptp(board.points, axis=0).max())


def _seen_in_sheet(observations: Observations, laser: int, lasers: int) -> Array:
    """Image points ``(K, 2)`` of what is known to lie in a sheet."""
    plane, crossing, line = observations.plane, observations.crossing, observations.board.line
    points = [plane.uv[plane.lasers == laser].reshape(-1, 2), line.uv[line.laser == laser]]
    if len(crossing):
        points.append(crossing.uv[:, laser - lasers])  # spots come behind the markers
    every = np.concatenate(points)
    return every[np.isfinite(every).all(axis=1)]


def _grid(seen: Array) -> Array:
    """Middles ``(9, 2)`` of the nine equal parts of the smallest upright box."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    steps = (np.arange(_PLACES) + 0.5) / _PLACES
    u, v = np.meshgrid(*(low[i] + steps * (high[i] - low[i]) for i in range(2)))
    return np.stack([u.ravel(), v.ravel()], axis=1)


def _segments(
    calibration: Calibration, laser: str, centres: Array, longest: float
) -> list[FieldSegment]:
    middle = calibration.triangulate(centres, laser)
    along = np.stack([_tangents(calibration, laser, centres, axis) for axis in range(2)])
    for length in longest * 0.5 ** np.arange(_HALVINGS):
        half = 0.5 * length * along
        ends = calibration.camera.project(np.stack([middle - half, middle + half], axis=2))
        inside = _in_picture(calibration, ends)
        if inside.mean() >= _ENOUGH:
            return [
                FieldSegment(_name(float(length), axis, centres[place]), laser, ends[axis, place])
                for axis, place in np.argwhere(inside)
            ]
    return []


def _tangents(calibration: Calibration, laser: str, centres: Array, axis: int) -> Array:
    """Unit directions ``(K, 3)`` in the sheet that appear along u (axis 0) or v (axis 1)."""
    step = _TANGENT_PX * np.eye(2)[axis]
    before, after = (calibration.triangulate(centres + s, laser) for s in (-step, step))
    return normalised(after - before)


def _in_picture(calibration: Calibration, ends: Array) -> np.ndarray:
    last = np.array(calibration.camera.image_size) - 0.5
    with np.errstate(invalid="ignore"):
        return np.asarray(((ends >= -0.5) & (ends <= last)).all(axis=(-1, -2)))


def _name(length: float, axis: int, centre: Array) -> str:
    return f"{length:g} mm along {DIRECTIONS[axis]} at ({centre[0]:.0f}, {centre[1]:.0f})"
