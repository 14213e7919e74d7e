"""Random target positions, and the image points they give."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.simulation.rig import SimulatedRig

_BATCH = 4096
_BATCHES = 200


def target_points(origins: Array, directions: Array, positions: Array) -> Array:
    """Markers ``(N, M, 3)`` of targets from marker 0 ``(N, 3)`` along ``(N, 3)``, mm."""
    return origins[:, None, :] + positions[:, None] * directions[:, None, :]


def in_picture(camera: Camera, points: Array, margin_px: float = 0.0) -> np.ndarray:
    """Mask ``(...)`` of the points ``(..., 3)`` that fall inside the picture's margin."""
    uv = camera.project(points)
    size = np.array(camera.image_size) - 1.0
    with np.errstate(invalid="ignore"):
        return np.asarray(((uv >= margin_px) & (uv <= size - margin_px)).all(axis=-1))


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

    return _drawn(rig, count, margin_px, draw, "pivot views")


def in_plane_poses(
    rig: SimulatedRig, count: int, rng: np.random.Generator, margin_px: float = 0.0
) -> tuple[Array, Array]:
    """Targets lying in the sheet, their middle in `depth_mm`, all markers in the picture.

    Returns
    -------
    origins, directions : (count, 3)
    """
    first, second = tangent_basis(rig.light_plane.normal)
    middle = rig.target.length_mm / 2

    def draw(n: int) -> tuple[Array, Array]:
        centres = points_in_sheet(rig, n, rng)
        angle = rng.uniform(0.0, 2 * np.pi, n)
        directions = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        return centres - middle * directions, directions

    return _drawn(rig, count, margin_px, draw, "in-plane views")


def points_in_sheet(rig: SimulatedRig, count: int, rng: np.random.Generator) -> Array:
    """Random points ``(count, 3)`` of the sheet that the camera sees, Z uniform in `depth_mm`."""
    camera, plane = rig.camera, rig.light_plane
    z = rng.uniform(*rig.depth_mm, count)
    v = rng.uniform(0.0, camera.image_size[1] - 1.0, count)
    y = (v - camera.v0) / camera.beta * z
    x = (plane.distance_mm - plane.normal[1] * y - plane.normal[2] * z) / plane.normal[0]
    return np.stack([x, y, z], axis=-1)


def observed(
    camera: Camera,
    points: Array,
    pixel_std: float,
    rng: np.random.Generator,
    name: str = "view",
) -> TargetViews:
    """Image points of markers ``(N, M, 3)`` with independent normal noise."""
    uv = camera.project(points)
    uv = uv + rng.normal(scale=pixel_std, size=uv.shape) if pixel_std else uv
    width = max(2, len(str(len(uv) - 1)))
    return TargetViews(tuple(f"{name}{i:0{width}d}" for i in range(len(uv))), uv)


def observed_rig(
    rig: SimulatedRig,
    camera_views: int,
    plane_views: int,
    pixel_std: float,
    rng: np.random.Generator,
) -> Observations:
    """Image points of both stages with independent normal noise."""
    positions = rig.target.positions
    pivot = target_points(*pivot_poses(rig, camera_views, rng), positions)
    lying = target_points(*in_plane_poses(rig, plane_views, rng), positions)
    return Observations(
        camera=observed(rig.camera, pivot, pixel_std, rng, "camera"),
        plane=observed(rig.camera, lying, pixel_std, rng, "plane"),
    )


def segments_in_sheet(
    rig: SimulatedRig, length_mm: float, count: int, rng: np.random.Generator, margin_px: float = 0
) -> Array:
    """Both ends ``(count, 2, 3)`` of random segments in the sheet, in the picture and with both
    ends within `depth_mm` (the paper's range of motion, section 4.2.1)."""
    first, second = tangent_basis(rig.light_plane.normal)

    nearest, farthest = rig.depth_mm

    def draw(n: int) -> tuple[Array, Array]:
        centres = points_in_sheet(rig, n, rng)
        angle = rng.uniform(0.0, 2 * np.pi, n)
        directions = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        origins = centres - length_mm / 2 * directions
        z = np.stack([origins[:, 2], (origins + length_mm * directions)[:, 2]])
        good = (z.min(axis=0) >= nearest) & (z.max(axis=0) <= farthest)
        return origins[good], directions[good]

    ends = np.array([0.0, length_mm])
    origins, directions = _drawn(rig, count, margin_px, draw, "segments", ends)
    return target_points(origins, directions, ends)


def _drawn(
    rig: SimulatedRig,
    count: int,
    margin_px: float,
    draw: Callable[[int], tuple[Array, Array]],
    what: str,
    positions: Array | None = None,
) -> tuple[Array, Array]:
    """Draw poses until `count` of them lie wholly in the picture."""
    positions = rig.target.positions if positions is None else positions
    origins: list[Array] = [np.empty((0, 3))]
    directions: list[Array] = [np.empty((0, 3))]
    found = 0
    for _ in range(_BATCHES):
        if found >= count:
            break
        start, along = draw(_BATCH)
        points = target_points(start, along, positions)
        good = in_picture(rig.camera, points, margin_px).all(axis=1)
        origins.append(start[good])
        directions.append(along[good])
        found += int(good.sum())
    if found < count:
        raise InputError(
            f"only {found} of {count} {what} lie wholly in the picture",
            "use a shorter target, a larger distance or a wider lens",
        )
    return np.concatenate(origins)[:count], np.concatenate(directions)[:count]
