"""Random target positions, and the image points they give."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.simulation.curved_lines import spots_of_light
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.visible import in_picture, target_points, visible_poses

Placement = Literal["rod", "markers"]

_LEAST_CROSSING = math.sin(math.radians(15.0))
"""Sine of the flattest angle at which a crossing target meets the sheet."""
_END_SHARE = 0.05
"""Least distance of a spot from the ends of the target, as a share of its length."""
_LARGEST_PLACEMENT = 0.1
_STRAIGHT = "nothing straight lies in it"
"""Farther off, as a share of its length, a target no longer lies in the sheet."""


@dataclass(frozen=True)
class Recording:
    """How much is recorded of a rig, and how well.

    Parameters
    ----------
    camera_views : int
    plane_views, crossing_views : int
        For each laser.
    pixel_std : float
        Standard deviation of the image coordinates, px.
    placement_mm : float
        Standard deviation of how far a target laid into the sheet lies off it, mm.
    placement : {"rod", "markers"}
        What lies off: the two ends of a straight rod, independently, with the markers between
        them in line; or each marker by itself.
    """

    camera_views: int
    plane_views: int
    crossing_views: int = 0
    pixel_std: float = 0.0
    placement_mm: float = 0.0
    placement: Placement = "rod"

    def __post_init__(self) -> None:
        sizes = (self.camera_views, self.plane_views, self.crossing_views)
        if min(*sizes, self.pixel_std, self.placement_mm) < 0:
            raise InputError(f"{self} has a negative part", "give 0 or more")
        if self.placement not in get_args(Placement):
            raise InputError(
                f"placement is '{self.placement}'", f"choose {' | '.join(get_args(Placement))}"
            )


@dataclass(frozen=True, eq=False)
class PlacedTargets:
    """Where the markers are in every view of a recording, mm, camera frame.

    Parameters
    ----------
    camera : (N, M, 3) array
    plane : (P, M, 3) array
    plane_lasers : (P,) int array
        In whose sheet the target lies.
    crossing : (C, M, 3) array
    crossing_lasers : (C,) int array
        Whose sheet crosses the target.
    spots : (C, lasers, 3) array
        Where it does; NaN for the other lasers.
    """

    camera: Array
    plane: Array
    plane_lasers: np.ndarray
    crossing: Array
    crossing_lasers: np.ndarray
    spots: Array


def pivot_poses(
    rig: SimulatedRig, count: int, rng: np.random.Generator, margin_px: float = 0.0
) -> tuple[Array, Array]:
    """Targets swung about the anchor in random directions, all markers in the picture.

    Returns
    -------
    origins, directions : (count, 3)
    """

    def draw(n: int) -> tuple[Array, Array]:
        directions = normalised(rng.normal(size=(n, 3)))
        return np.broadcast_to(rig.anchor_mm, (n, 3)), directions

    return visible_poses(rig, count, margin_px, draw, "pivot views")


def in_plane_poses(
    rig: SimulatedRig,
    count: int,
    rng: np.random.Generator,
    margin_px: float = 0.0,
    laser: int = 0,
) -> tuple[Array, Array]:
    """Targets lying in the sheet of laser number `laser`, all markers in the picture.

    Their middles are those of `points_in_sheet`, their directions in the sheet are uniform.

    Returns
    -------
    origins, directions : (count, 3)
    """
    middle = rig.target.length_mm / 2

    def draw(n: int) -> tuple[Array, Array]:
        centres = points_in_sheet(rig, n, rng, laser)
        directions = _directions_in(rig.flat_sheet(laser, _STRAIGHT), n, rng)
        return centres - middle * directions, directions

    return visible_poses(rig, count, margin_px, draw, "in-plane views")


def crossing_poses(
    rig: SimulatedRig,
    count: int,
    rng: np.random.Generator,
    margin_px: float = 0.0,
    laser: int = 0,
) -> tuple[Array, Array]:
    """Targets in random directions that the sheet of laser number `laser` crosses.

    The spot is one of `points_in_sheet`. It lies uniformly along the target, but at least 5 %
    of its length from either end; the angle between target and sheet is 15° or more. All
    markers and the spot are in the picture.

    Returns
    -------
    origins, directions : (count, 3)
    """
    length, normal = rig.target.length_mm, rig.light_planes[laser].normal

    def draw(n: int) -> tuple[Array, Array]:
        spots = points_in_sheet(rig, n, rng, laser)
        directions = normalised(rng.normal(size=(n, 3)))
        along = rng.uniform(_END_SHARE, 1.0 - _END_SHARE, n) * length
        good = np.abs(directions @ normal) >= _LEAST_CROSSING
        good &= in_picture(rig.camera, spots, margin_px)
        return (spots - along[:, None] * directions)[good], directions[good]

    return visible_poses(rig, count, margin_px, draw, "crossing views")


def crossing_spots(plane: LightPlane, origins: Array, directions: Array) -> Array:
    """Points ``(N, 3)`` in which lines from ``(N, 3)`` along ``(N, 3)`` meet a sheet."""
    return origins + plane.along(origins, directions)[:, None] * directions


def points_in_sheet(
    rig: SimulatedRig, count: int, rng: np.random.Generator, laser: int = 0
) -> Array:
    """Random points ``(count, 3)`` of the sheet of laser number `laser`.

    Their Z is uniform in `depth_mm`. In one depth the sheet is a straight line in the picture;
    along it the points are uniform between the picture's upper and lower edge, or between its
    left and right edge where the line runs more along u than along v. Every point of the
    sheet that is seen through an undistorted lens can be drawn, and some that are not seen.
    """
    camera, plane = rig.camera, rig.light_planes[laser]
    z = rng.uniform(*rig.depth_mm, count)
    drawn, solved = (1, 0) if abs(plane.normal[0]) >= abs(plane.normal[1]) else (0, 1)
    pixel = rng.uniform(0.0, camera.image_size[drawn] - 1.0, count)
    centre, focal = ((camera.u0, camera.alpha), (camera.v0, camera.beta))[drawn]
    points = np.stack([np.empty(count), np.empty(count), z], axis=-1)
    points[:, drawn] = (pixel - centre) / focal * z
    rest = plane.distance_mm - plane.normal[drawn] * points[:, drawn] - plane.normal[2] * z
    points[:, solved] = rest / plane.normal[solved]
    return points if plane.curvature is None else plane.intersect(points / points[:, 2:])


def segments_in_sheet(
    rig: SimulatedRig,
    length_mm: float,
    count: int,
    rng: np.random.Generator,
    margin_px: float = 0,
    laser: int = 0,
) -> Array:
    """Both ends ``(count, 2, 3)`` of random segments in the sheet, in the picture and with both
    ends within `depth_mm` (the paper's range of motion, section 4.2.1)."""
    nearest, farthest = rig.depth_mm

    def draw(n: int) -> tuple[Array, Array]:
        centres = points_in_sheet(rig, n, rng, laser)
        directions = _directions_in(rig.flat_sheet(laser, _STRAIGHT), n, rng)
        origins = centres - length_mm / 2 * directions
        z = np.stack([origins[:, 2], (origins + length_mm * directions)[:, 2]])
        good = (z.min(axis=0) >= nearest) & (z.max(axis=0) <= farthest)
        return origins[good], directions[good]

    ends = np.array([0.0, length_mm])
    origins, directions = visible_poses(rig, count, margin_px, draw, "segments", ends)
    return target_points(origins, directions, ends)


def placed_targets(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator
) -> PlacedTargets:
    """Random targets for every view of a recording, laser by laser."""
    positions, lasers = rig.target.positions, range(len(rig.light_planes))
    pivoting = target_points(*pivot_poses(rig, recording.camera_views, rng), positions)
    lying = [lying_targets(rig, recording, rng, laser) for laser in lasers]
    crossing, spots = zip(*(crossed_targets(rig, recording, rng, k) for k in lasers), strict=True)
    return PlacedTargets(
        camera=pivoting,
        plane=np.concatenate(lying),
        plane_lasers=np.repeat(lasers, recording.plane_views),
        crossing=np.concatenate(crossing),
        crossing_lasers=np.repeat(lasers, recording.crossing_views),
        spots=np.concatenate(spots),
    )


def lying_targets(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, laser: int = 0
) -> Array:
    """Markers ``(plane_views, M, 3)`` of targets laid into a sheet at random."""
    poses = in_plane_poses(rig, recording.plane_views, rng, laser=laser)
    return laid_in_sheet(rig, poses, recording, rng, laser)


def laid_in_sheet(
    rig: SimulatedRig,
    poses: tuple[Array, Array],
    recording: Recording,
    rng: np.random.Generator,
    laser: int = 0,
) -> Array:
    """Markers ``(N, M, 3)`` of targets laid into a sheet at given poses, as far off it as the
    recording says."""
    positions, std = rig.target.positions, recording.placement_mm
    if not std:
        return target_points(*poses, positions)
    if std > _LARGEST_PLACEMENT * positions[-1]:
        raise InputError(
            f"targets of {positions[-1]:g} mm are placed with a standard deviation of {std:g} mm",
            f"keep placement_mm below {_LARGEST_PLACEMENT * positions[-1]:g}",
        )
    normal, (origins, directions) = rig.light_planes[laser].normal, poses
    if recording.placement == "markers":
        off = rng.normal(scale=std, size=(len(origins), len(positions), 1))
        return target_points(origins, directions, positions) + off * normal
    near, far = rng.normal(scale=std, size=(2, len(origins), 1))
    sine = (far - near) / positions[-1]
    tilted = np.sqrt(1.0 - sine**2) * directions + sine * normal
    return target_points(origins + near * normal, tilted, positions)


def crossed_targets(
    rig: SimulatedRig, recording: Recording, rng: np.random.Generator, laser: int = 0
) -> tuple[Array, Array]:
    """Markers ``(crossing_views, M, 3)`` of targets that a sheet crosses, and the spots
    ``(crossing_views, lasers, 3)``, NaN but for this laser's."""
    poses = crossing_poses(rig, recording.crossing_views, rng, laser=laser)
    spots = np.full((recording.crossing_views, len(rig.light_planes), 3), np.nan)
    spots[:, laser] = spots_of_light(rig, laser, *poses)
    return target_points(*poses, rig.target.positions), spots


def observed(
    camera: Camera,
    points: Array,
    pixel_std: float,
    rng: np.random.Generator,
    name: str = "view",
    spots: Array | None = None,
    laser: np.ndarray | None = None,
) -> TargetViews:
    """Image points of markers ``(N, M, 3)``, and of spots ``(N, lasers, 3)`` in the columns
    after them, with independent normal noise; `laser` ``(N,)`` is handed on."""
    uv = camera.project(points if spots is None else np.concatenate([points, spots], axis=1))
    uv = uv + rng.normal(scale=pixel_std, size=uv.shape) if pixel_std else uv
    width = max(2, len(str(len(uv) - 1)))
    names = tuple(f"{name}{i:0{width}d}" for i in range(len(uv)))
    return TargetViews(names, uv, laser=laser)


def photographed(
    camera: Camera, placed: PlacedTargets, pixel_std: float, rng: np.random.Generator
) -> Observations:
    """Image points of placed targets with independent normal noise."""
    return Observations(
        camera=observed(camera, placed.camera, pixel_std, rng, "camera"),
        plane=observed(camera, placed.plane, pixel_std, rng, "plane", laser=placed.plane_lasers),
        crossing=observed(camera, placed.crossing, pixel_std, rng, "crossing", placed.spots),
    )


def recorded(rig: SimulatedRig, recording: Recording, rng: np.random.Generator) -> Observations:
    """Image points of a recording of random targets."""
    placed = placed_targets(rig, recording, rng)
    return photographed(rig.camera, placed, recording.pixel_std, rng)


def observed_rig(
    rig: SimulatedRig,
    camera_views: int,
    plane_views: int,
    pixel_std: float,
    rng: np.random.Generator,
    crossing_views: int = 0,
    placement_mm: float = 0.0,
    placement: Placement = "rod",
) -> Observations:
    """Image points of all stages with independent normal noise; see `Recording`."""
    recording = Recording(
        camera_views, plane_views, crossing_views, pixel_std, placement_mm, placement
    )
    return recorded(rig, recording, rng)


def _directions_in(plane: LightPlane, count: int, rng: np.random.Generator) -> Array:
    first, second = tangent_basis(plane.normal)
    angle = rng.uniform(0.0, 2 * np.pi, count)
    return np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
