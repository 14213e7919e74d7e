"""Rigs of every size and shape that occur, at random."""

from __future__ import annotations

import math

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import crossing_poses, in_plane_poses, pivot_poses
from sheetoflight.simulation.rig import SimulatedRig

IMAGE_SIZES = (
    (640, 480),
    (800, 600),
    (1280, 1024),
    (1392, 1040),
    (1600, 1200),
    (1920, 1200),
    (2048, 1536),
    (2448, 2048),
    (4096, 3000),
)
"""Usual picture sizes, px."""

FOCAL_PX = (600.0, 6000.0)
FIELD_DEG = (8.0, 75.0)
"""Field of view across the picture's width."""
ASPECT = 0.01
"""Largest relative difference of the focal lengths."""
DECENTRED = 0.03
"""Largest offset of the principal point from the picture's middle, as a share of its size."""
SHEET_DEG = (15.0, 70.0)
"""Angle between sheet and optical axis."""
DISTANCE_MM = (100.0, 5000.0)
"""Working distance."""
LENGTH_SHARE = (0.25, 0.60)
"""Length of the target over the smaller side of the field at the working distance."""
MARKERS = (3, 9)
DEPTH_SHARE = (0.15, 0.25)
"""Half of the depth range over the working distance."""

_ANCHOR_ASIDE = 0.25
"""How far the anchor may lie from the optical axis, as a share of half the field."""
_SHEET_ASIDE = 0.15
"""The same of the sheet: a flat one that lies farther off may pass by the camera too close."""
_NEARBY = 0.05
"""How far the anchor may lie before or behind the working distance, as a share of it."""
_UNEVEN = (0.5, 1.5)
"""Range of the gaps between markers before they are scaled to the target's length."""
_MARKER_SHARE = 0.5
"""Diameter of a marker over the smallest gap."""
_POSES = 200
"""So many poses of each kind must be found."""
_TRIES = 100


def random_rig(rng: np.random.Generator) -> SimulatedRig:
    """A random rig with one laser, in which targets can be placed for every stage.

    Focal length and working distance are uniform in their logarithms, everything else in
    itself, within this module's ranges; the lens does not distort. A rig in which poses are too
    rarely wholly in the picture is drawn again.

    Raises
    ------
    InputError
        If no rig is found; the odds are negligible.
    """
    for _ in range(_TRIES):
        rig = _drawn_rig(rng)
        if _has_room(rig, rng):
            return rig
    raise InputError(f"none of {_TRIES} random rigs leaves room for the target", "try again")


def _drawn_rig(rng: np.random.Generator) -> SimulatedRig:
    camera, distance = _camera(rng), _log_uniform(rng, DISTANCE_MM)
    plane = _sheet(camera, distance, rng)
    reach = distance * rng.uniform(*DEPTH_SHARE)
    return SimulatedRig(
        camera=camera,
        light_planes=(plane,),
        target=_target(camera, distance, rng),
        anchor_mm=_anchor(camera, distance, rng),
        projector_mm=_level_with_camera(plane),
        depth_mm=(distance - reach, distance + reach),
    )


def _has_room(rig: SimulatedRig, rng: np.random.Generator) -> bool:
    try:
        for poses in (pivot_poses, in_plane_poses, crossing_poses):
            poses(rig, _POSES, rng)
    except InputError:
        return False
    return True


def _camera(rng: np.random.Generator) -> Camera:
    focal = _log_uniform(rng, FOCAL_PX)
    fitting = [
        size for size in IMAGE_SIZES if FIELD_DEG[0] <= field_deg(size, focal) <= FIELD_DEG[1]
    ]
    width, height = fitting[rng.integers(len(fitting))]
    aside = rng.uniform(-DECENTRED, DECENTRED, 2)
    return Camera(
        (width, height),
        alpha=focal,
        beta=focal * (1.0 + rng.uniform(-ASPECT, ASPECT)),
        u0=(width - 1) / 2 + aside[0] * width,
        v0=(height - 1) / 2 + aside[1] * height,
    )


def field_deg(image_size: tuple[int, int], focal_px: float) -> float:
    """Angle of view across the width of a picture, degrees."""
    return math.degrees(2.0 * math.atan(image_size[0] / (2.0 * focal_px)))


def _sheet(camera: Camera, distance: float, rng: np.random.Generator) -> LightPlane:
    """A sheet across the field at the working distance, with any roll about the optical axis."""
    angle, roll = math.radians(rng.uniform(*SHEET_DEG)), rng.uniform(0.0, 2.0 * math.pi)
    across = math.cos(angle)
    normal = np.array([across * math.cos(roll), across * math.sin(roll), math.sin(angle)])
    return LightPlane(normal, float(normal @ _beside_axis(camera, distance, _SHEET_ASIDE, rng)))


def _anchor(camera: Camera, distance: float, rng: np.random.Generator) -> Array:
    z = distance * (1.0 + rng.uniform(-_NEARBY, _NEARBY))
    return _beside_axis(camera, z, _ANCHOR_ASIDE, rng)


def _target(camera: Camera, distance: float, rng: np.random.Generator) -> CollinearTarget:
    length = min(_field_mm(camera, distance)) * rng.uniform(*LENGTH_SHARE)
    gaps = rng.uniform(*_UNEVEN, rng.integers(MARKERS[0], MARKERS[1] + 1) - 1)
    gaps *= length / gaps.sum()
    return CollinearTarget((0.0, *np.cumsum(gaps)), marker_size_mm=_MARKER_SHARE * gaps.min())


def _field_mm(camera: Camera, z: float) -> Array:
    """Width and height ``(2,)`` of the field at a depth."""
    return z * np.array(camera.image_size) / np.array([camera.alpha, camera.beta])


def _beside_axis(camera: Camera, z: float, share: float, rng: np.random.Generator) -> Array:
    """A point ``(3,)`` at a depth, off the axis by up to a share of half the field."""
    return np.append(_field_mm(camera, z) / 2 * rng.uniform(-share, share, 2), z)


def _level_with_camera(plane: LightPlane) -> Array:
    """The point of the sheet with Z = 0 that is nearest to the camera."""
    across = plane.normal[:2]
    return np.append(plane.distance_mm * across / (across @ across), 0.0)


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))
