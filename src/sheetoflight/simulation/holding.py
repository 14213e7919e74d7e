"""Targets and bars held as a person would hold them: wholly in view, and not edge-on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.simulation.poses import in_picture
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.scene import facing_direction, strip_axes

_TRIES = 100
_DRAWN_AT_ONCE = 20


@dataclass(frozen=True)
class Holding:
    """What is asked of a pose.

    Parameters
    ----------
    max_tilt_deg : float
        Largest angle between the strip's surface normal and the direction to the camera and,
        where `laser` is set, to the projector.
    margin_px : float
        Least distance of markers' rims and bars' ends from the picture's edge, px.
    radius_mm : float
        Radius of a marker, or half of a bar's width, mm.
    laser : bool
        Whether the strip is turned midway between camera and projector, and must be lit.
    """

    max_tilt_deg: float
    margin_px: float
    radius_mm: float
    laser: bool

    def accepts(self, rig: SimulatedRig, points: Array) -> bool:
        """Whether a strip through points ``(M, 3)`` on its axis is well in view, and lit."""
        return self._in_view(rig, points) and self._square_enough(rig, points)

    def _in_view(self, rig: SimulatedRig, points: Array) -> bool:
        aside = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
        rims = points[:, None, :] + self.radius_mm * aside
        return bool(np.all(in_picture(rig.camera, rims, self.margin_px)))

    def _square_enough(self, rig: SimulatedRig, points: Array) -> bool:
        facing = facing_direction(rig, (points[0] + points[-1]) / 2, self.laser)
        normal = np.cross(*strip_axes(points[-1] - points[0], facing))
        sources = [np.zeros(3), rig.projector_mm] if self.laser else [np.zeros(3)]
        cosines = np.array([normalised(source - points) @ normal for source in sources])
        cosines *= np.sign(cosines.flat[0])
        return bool(cosines.min() >= math.cos(math.radians(self.max_tilt_deg)))


def held(
    rig: SimulatedRig,
    count: int,
    draw: Callable[[int], Array],
    holding: Holding,
    what: str,
) -> list[Array]:
    """The first `count` acceptable poses of those drawn.

    Parameters
    ----------
    rig : SimulatedRig
    count : int
    draw : callable
        Gives n random poses as points ``(n, M, 3)`` along each strip's axis, mm.
    holding : Holding
    what : str
        Name of the views, for the error.

    Returns
    -------
    list of (M, 3) arrays

    Raises
    ------
    InputError
        If too few of the poses drawn are acceptable.
    """
    found: list[Array] = []
    for _ in range(_TRIES):
        if len(found) >= count:
            return found[:count]
        found += [points for points in draw(_DRAWN_AT_ONCE) if holding.accepts(rig, points)]
    raise InputError(
        f"only {len(found)} of {count} {what} could be held wholly in the picture, "
        f"tilted by up to {holding.max_tilt_deg:g}°",
        "use a shorter target, a larger distance, a wider lens or a larger max_tilt_deg",
    )
