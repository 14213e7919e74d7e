"""Targets that are wholly in the picture, chosen among random ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.simulation.rig import SimulatedRig

_BATCH = 4096
_BATCHES = 200
_PIECE = 256


def target_points(origins: Array, directions: Array, positions: Array) -> Array:
    """Markers ``(N, M, 3)`` of targets from marker 0 ``(N, 3)`` along ``(N, 3)``, mm."""
    return origins[:, None, :] + positions[:, None] * directions[:, None, :]


def in_picture(camera: Camera, points: Array, margin_px: float = 0.0) -> np.ndarray:
    """Mask ``(...)`` of the points ``(..., 3)`` that fall inside the picture's margin."""
    uv = camera.project(points)
    size = np.array(camera.image_size) - 1.0
    with np.errstate(invalid="ignore"):
        return np.asarray(((uv >= margin_px) & (uv <= size - margin_px)).all(axis=-1))


def visible_poses(
    rig: SimulatedRig,
    count: int,
    margin_px: float,
    draw: Callable[[int], tuple[Array, Array]],
    what: str,
    positions: Array | None = None,
) -> tuple[Array, Array]:
    """The first `count` of the poses drawn whose markers are all in the picture.

    Parameters
    ----------
    rig : SimulatedRig
    count : int
    margin_px : float
        Least distance from the picture's edge, px.
    draw : callable
        Gives up to n random poses as origins and directions ``(≤ n, 3)``.
    what : str
        Name of the views, for the error.
    positions : (M,) array, optional
        What must be in the picture, mm along the direction; by default the target's markers.

    Returns
    -------
    origins, directions : (count, 3)

    Raises
    ------
    InputError
        If too few of the poses drawn are in the picture.
    """
    positions = rig.target.positions if positions is None else positions
    origins: list[Array] = [np.empty((0, 3))]
    directions: list[Array] = [np.empty((0, 3))]
    found = 0
    for start, along in _pieces(draw) if count else ():
        points = target_points(start, along, positions)
        good = in_picture(rig.camera, points, margin_px).all(axis=1)
        origins.append(start[good])
        directions.append(along[good])
        found += int(good.sum())
        if found >= count:
            break
    if found < count:
        raise InputError(
            f"only {found} of {count} {what} lie wholly in the picture",
            "use a shorter target, a larger distance or a wider lens",
        )
    return np.concatenate(origins)[:count], np.concatenate(directions)[:count]


def _pieces(draw: Callable[[int], tuple[Array, Array]]) -> Iterator[tuple[Array, Array]]:
    """Many batches of poses, piece by piece: most often the first piece is enough."""
    for _ in range(_BATCHES):
        origins, directions = draw(_BATCH)
        for first in range(0, len(origins), _PIECE):
            yield origins[first : first + _PIECE], directions[first : first + _PIECE]
