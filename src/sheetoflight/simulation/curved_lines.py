"""Lines of light of curved sheets on flat faces, and their spots on straight targets."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.simulation.rig import SimulatedRig

_NEWTON_STEPS = 20


class Surface(Protocol):
    """A sheet of light of any shape: `LightPlane` or `LightCone`."""

    def heights(self, points: Array) -> Array:
        """How far points ``(..., 3)`` lie off it, mm; 0 on it."""
        ...

    def gradients(self, points: Array) -> Array:
        """Derivatives ``(..., 3)`` of `heights` by the point."""
        ...


def met(surface: Surface, starts: Array, directions: Array) -> Array:
    """Points ``(N, 3)`` where lines meet a surface, by Newton's iteration.

    It uses nothing but heights and gradients: not the quadratic that `LightPlane.along` solves,
    which is to be tested against it.

    Parameters
    ----------
    surface : Surface
    starts : (N, 3) array
        Points near the surface, mm.
    directions : (N, 3) array
        In which they may move.
    """
    points = starts
    for _ in range(_NEWTON_STEPS):
        steep = np.sum(surface.gradients(points) * directions, axis=-1)
        points = points - (surface.heights(points) / steep)[..., None] * directions
    return points


def spots_of_light(rig: SimulatedRig, laser: int, origins: Array, directions: Array) -> Array:
    """Points ``(N, 3)`` in which lines from ``(N, 3)`` along ``(N, 3)`` meet a laser's light."""
    plane, surface = rig.light_planes[laser], rig.surface(laser)
    spots = origins + plane.along(origins, directions)[:, None] * directions
    return spots if surface is plane else met(surface, spots, directions)


def line_on_face(surface: Surface, corners: Array, chord: Array) -> tuple[Array, Array]:
    """The line of a curved sheet on a flat face.

    Parameters
    ----------
    surface : Surface
    corners : (K, 3) array
        Of the face, convex, in order around it, mm.
    chord : (P, 3) array
        Points in which the sheet's plane meets the face; each moves across them, within the
        face, until it is on the surface. What lies beyond the face then is left out.

    Returns
    -------
    points, along : (Q, 3) arrays
        mm, and unit vectors along the line.
    """
    normal = _face_normal(corners)
    points = moved_across(surface, corners, chord)
    along = normalised(np.cross(surface.gradients(points), normal))
    inside = _inside(corners, normal, points)
    return points[inside], along[inside]


def moved_across(surface: Surface, corners: Array, chord: Array) -> Array:
    """Points ``(P, 3)`` of a face moved within it on to a surface, straight across the line that
    the surface makes on the face there."""
    normal = _face_normal(corners)
    across = surface.gradients(chord)
    across = across - (across @ normal)[:, None] * normal
    return met(surface, chord, normalised(across))


def _face_normal(corners: Array) -> Array:
    return normalised(np.cross(corners[1] - corners[0], corners[2] - corners[0]))


def _inside(corners: Array, normal: Array, points: Array) -> np.ndarray:
    """Mask ``(P,)`` of points within a convex polygon in their plane."""
    sides = np.roll(corners, -1, axis=0) - corners
    from_corners = points[:, None, :] - corners
    turns = np.cross(sides, from_corners) @ normal
    return np.asarray((turns >= 0).all(axis=1) | (turns <= 0).all(axis=1))
