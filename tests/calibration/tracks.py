"""Points followed through the pictures of one camera, made up."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import normalised
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.camera import Camera

CAMERA = Camera((1400, 1000), 1500.0, 1480.0, 690.0, 510.0)
BARREL = Camera((1400, 1000), 1500.0, 1480.0, 690.0, 510.0, distortion=(-0.1, 0, 0, 0, 0))

TWO_AXES = [[0, 0, 0], [0.2, 0, 0], [-0.2, 0.1, 0], [0, 0.3, 0.1], [0, -0.3, 0.3], [0.2, 0.2, -0.3]]


def turning(camera: Camera, turns: list, count: int, rng: np.random.Generator) -> np.ndarray:
    """``(V, T, 2)`` of directions seen from one point, the first of `turns` being 0."""
    rotations = rotation(np.array(turns, dtype=float))
    picture = np.array(camera.image_size) - 1.0
    first = camera.unproject(rng.uniform(0, 1, (count, 2)) * picture)
    view = rng.integers(0, len(turns), count)
    directions = normalised(np.einsum("tji,tj->ti", rotations[view], first))
    return framed(camera, np.einsum("vij,tj->vti", rotations, directions))


def moving(
    camera: Camera, rotations: np.ndarray, translations: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """``(V, T, 2)`` of points in space."""
    return framed(camera, np.einsum("vij,tj->vti", rotations, points) + translations[:, None])


def framed(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Image points, NaN outside the picture."""
    uv = camera.project(points)
    inside = np.all((uv >= 0) & (uv <= np.array(camera.image_size) - 1), axis=-1)
    return np.where(np.asarray(inside)[..., None], uv, np.nan)


def scene(count: int, rng: np.random.Generator) -> np.ndarray:
    """Points about one metre before the first view, mm."""
    return rng.uniform([-300, -220, 750], [300, 220, 1250], (count, 3))


def carried(views: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and translations of views from all around that look at the scene, rolled; the
    first is at rest."""
    rotations, centres = [np.eye(3)], [np.zeros(3)]
    for _ in range(views - 1):
        centre = rng.uniform([-350, -350, -200], [350, 350, 200])
        z = np.array([0, 0, 1000.0]) + rng.uniform(-60, 60, 3) - centre
        z /= np.linalg.norm(z)
        x = normalised(np.cross([0.0, 1.0, 0.0], z))
        roll = rotation(np.array([0, 0, rng.uniform(-0.8, 0.8)]))
        rotations.append(roll @ np.stack([x, np.cross(z, x), z]))
        centres.append(centre)
    turned = np.stack(rotations)
    return turned, -np.einsum("vij,vj->vi", turned, np.stack(centres))
