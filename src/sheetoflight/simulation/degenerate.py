"""Recordings in which one stage does not determine what it is recorded for, or all but.

Everything that is seen is right; but the camera does not follow from the camera stage, or a sheet
not from the plane stage. Other stages may still help out: targets in a sheet have something to
say of the camera too. Each function takes a rig, a recording and a random generator; stages that
it says nothing about are recorded as usual.

Every direction ``e`` of a pivoting target gives one equation, ``eᵀ S e = 1``, for the symmetric
matrix S of camera and depth of the fixed point (Zhang, "Camera calibration with one-dimensional
objects", IEEE PAMI 26(7), 2004): S is not determined where all directions lie on a quadric cone,
``eᵀ Q e = 0``. If the skew is known, Q₁₂ must be 0 besides. All swings here are degenerate
with and without skew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.simulation.poses import (
    Recording,
    in_plane_poses,
    laid_in_sheet,
    photographed,
    pivot_poses,
    placed_targets,
    points_in_sheet,
    recorded,
)
from sheetoflight.simulation.rig import SimulatedRig, field_centre
from sheetoflight.simulation.visible import target_points, visible_poses

Degenerate = Callable[[SimulatedRig, Recording, np.random.Generator], Observations]

_LEAST_TO_SIGHT = math.sin(math.radians(20.0))
"""Sine of the flattest angle between a plane of swings and the line of sight to its pivot."""
_LEAST_COSINE, _LARGEST_COSINE = math.cos(math.radians(70.0)), math.cos(math.radians(20.0))
"""Half-angles of a cone are 20° to 70°, neither pencil nor plane; two planes differ by 20°."""
_CANDIDATES = 256


def planar_swings(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator
) -> Observations:
    """Camera stage: all directions lie in one plane, which does not pass through the camera."""
    count = recording.camera_views
    return _swung(rig, recording, _on_cone(rig, count, _swing_plane(rig, rng), 0.0, rng), rng)


def swings_in_two_planes(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator
) -> Observations:
    """Camera stage: the directions lie by turns in one and another plane.

    The planes ``m · e = 0``, ``n · e = 0`` form the cone ``Q = m nᵀ + n mᵀ``, with Q₁₂ = 0.
    """
    count = recording.camera_views
    normal = _swing_plane(rig, rng)
    other = _second_swing_plane(rig, normal, rng)
    directions = np.empty((count, 3))
    directions[::2] = _on_cone(rig, (count + 1) // 2, normal, 0.0, rng)
    directions[1::2] = _on_cone(rig, count // 2, other, 0.0, rng)
    return _swung(rig, recording, directions, rng)


def conical_swings(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator
) -> Observations:
    """Camera stage: the target sweeps a circular cone about an axis through the fixed point.

    The axis ``a`` is square to the camera's x or y axis; with the half-angle θ the cone is
    ``Q = a aᵀ − cos²θ I``, with Q₁₂ = 0.
    """
    axis, cosine = _swing_cone(rig, rng)
    directions = _on_cone(rig, recording.camera_views, axis, cosine, rng)
    return _swung(rig, recording, directions, rng)


def few_camera_views(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, count: int = 1
) -> Observations:
    """Camera stage: one or two views."""
    return recorded(rig, replace(recording, camera_views=count), rng)


def repeated_position(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator
) -> Observations:
    """Plane stage: every view shows the target in one position, with noise of its own."""
    placed = placed_targets(rig, recording, rng)
    first = np.arange(len(placed.plane)) // recording.plane_views * recording.plane_views
    return photographed(
        rig.camera, replace(placed, plane=placed.plane[first]), recording.pixel_std, rng
    )


def parallel_positions(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, count: int = 3
) -> Observations:
    """Plane stage: `count` views with all targets parallel."""
    few = replace(recording, plane_views=count)
    placed = placed_targets(rig, few, rng)
    lying = [_parallel(rig, few, rng, laser) for laser in range(len(rig.light_planes))]
    return photographed(
        rig.camera, replace(placed, plane=np.concatenate(lying)), recording.pixel_std, rng
    )


def sheet_near_camera(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, share: float = 0.0
) -> Observations:
    """The first sheet passes the camera's centre at a share of the working distance; see
    `with_sheet_at`."""
    return recorded(with_sheet_at(rig, share * sum(rig.depth_mm) / 2), recording, rng)


def with_sheet_at(rig: SimulatedRig, distance_mm: float) -> SimulatedRig:
    """The rig with its first sheet turned to pass the camera's centre at a distance.

    It keeps the line that it shares with the plane ``Z = (Z_near + Z_far)/2``. At 0 mm the sheet
    passes through the centre and is seen as a line (the smallest positive number stands for 0).
    """
    plane, centre = rig.flat_sheet(0, "only flat ones are turned"), field_centre(rig)
    along = normalised(np.array([-plane.normal[1], plane.normal[0], 0.0]))
    reach = float(np.linalg.norm(centre))  # the centre is the line's nearest point to the axis
    towards = centre / reach
    sine = distance_mm / reach
    normal = sine * towards + math.sqrt(1.0 - sine**2) * np.cross(along, towards)
    turned = LightPlane(normal, max(distance_mm, np.finfo(float).tiny), plane.name)
    return replace(rig, light_planes=(turned, *rig.light_planes[1:]))


DEGENERATE: dict[str, Degenerate] = {
    "planar swings": planar_swings,
    "swings in two planes": swings_in_two_planes,
    "conical swings": conical_swings,
    "one camera view": few_camera_views,
    "two camera views": partial(few_camera_views, count=2),
    "repeated position": repeated_position,
    "parallel positions": parallel_positions,
    "sheet through camera": sheet_near_camera,
    "sheet near camera": partial(sheet_near_camera, share=0.01),
}
"""Every degenerate recording. The stages camera and plane must be recorded."""


def _swung(
    rig: SimulatedRig, recording: Recording, directions: Array, rng: np.random.Generator
) -> Observations:
    """A recording whose camera stage has given directions."""
    origins = np.broadcast_to(rig.anchor_mm, directions.shape)
    camera = target_points(origins, directions, rig.target.positions)
    placed = placed_targets(rig, replace(recording, camera_views=0), rng)
    return photographed(rig.camera, replace(placed, camera=camera), recording.pixel_std, rng)


def _on_cone(
    rig: SimulatedRig, count: int, axis: Array, cosine: float, rng: np.random.Generator
) -> Array:
    """Directions ``(count, 3)`` of a cone about an axis; of a plane where the cosine is 0."""
    first, second = tangent_basis(axis)
    sine = math.sqrt(1.0 - cosine**2)

    def draw(n: int) -> tuple[Array, Array]:
        angle = rng.uniform(0.0, 2.0 * np.pi, n)[:, None]
        around = np.cos(angle) * first + np.sin(angle) * second
        return np.broadcast_to(rig.anchor_mm, (n, 3)), cosine * axis + sine * around

    return visible_poses(rig, count, 0.0, draw, "pivot views")[1]


def _swing_plane(rig: SimulatedRig, rng: np.random.Generator) -> Array:
    """Normal ``(3,)`` of a plane with at least two directions in the picture."""
    one, two = _candidates(rig, 2, rng)
    normals = normalised(np.cross(one, two))
    return normals[_first(_oblique(rig, normals), "planes of swings")]


def _second_swing_plane(rig: SimulatedRig, normal: Array, rng: np.random.Generator) -> Array:
    """Normal n of another plane, with a direction in the picture and m₁ n₂ + m₂ n₁ = 0."""
    (one,) = _candidates(rig, 1, rng)
    others = normalised(np.cross(one, [normal[1], normal[0], 0.0]))
    good = _oblique(rig, others) & (np.abs(others @ normal) <= _LARGEST_COSINE)
    return others[_first(good, "planes of swings")]


def _swing_cone(rig: SimulatedRig, rng: np.random.Generator) -> tuple[Array, float]:
    """Axis ``(3,)`` of a cone with at least two directions in the picture, and the cosine of its
    half-angle."""
    one, two = _candidates(rig, 2, rng)
    square_to = np.eye(3)[rng.integers(2, size=len(one))]
    axes = normalised(np.cross(one - two, square_to))
    cosines = np.sum(axes * one, axis=-1)
    good = (np.abs(cosines) >= _LEAST_COSINE) & (np.abs(cosines) <= _LARGEST_COSINE)
    chosen = _first(good, "cones of swings")
    return axes[chosen], float(cosines[chosen])


def _candidates(rig: SimulatedRig, sets: int, rng: np.random.Generator) -> Array:
    """Sets ``(sets, n, 3)`` of random directions in the picture."""
    return pivot_poses(rig, sets * _CANDIDATES, rng)[1].reshape(sets, _CANDIDATES, 3)


def _oblique(rig: SimulatedRig, normals: Array) -> np.ndarray:
    """Which planes through the anchor pass well beside the camera."""
    return np.abs(normals @ normalised(rig.anchor_mm)) >= _LEAST_TO_SIGHT


def _first(good: np.ndarray, what: str) -> int:
    if not good.any():
        raise InputError(
            f"none of {len(good)} random {what} will do",
            "use a shorter target, a larger distance or a wider lens",
        )
    return int(np.argmax(good))


def _parallel(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, laser: int
) -> Array:
    """Markers ``(plane_views, M, 3)`` of parallel targets in a sheet."""
    along = in_plane_poses(rig, 1, rng, laser=laser)[1]

    def draw(n: int) -> tuple[Array, Array]:
        centres = points_in_sheet(rig, n, rng, laser)
        return centres - rig.target.length_mm / 2 * along, np.broadcast_to(along, (n, 3))

    poses = visible_poses(rig, recording.plane_views, 0.0, draw, "in-plane views")
    return laid_in_sheet(rig, poses, recording, rng, laser)
