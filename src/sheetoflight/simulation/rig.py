"""The rig that is simulated: what a calibration should find."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class SimulatedRig:
    """The truth behind simulated observations.

    Parameters
    ----------
    camera : Camera
    light_plane : LightPlane
    target : CollinearTarget
    anchor_mm : (3,) array
        Where marker 0 is fixed while the target pivots, camera frame.
    projector_mm : (3,) array
        Where the laser line projector stands, in the sheet of light.
    depth_mm : (float, float)
        Nearest and farthest Z of targets and objects in the sheet.
    """

    camera: Camera
    light_plane: LightPlane
    target: CollinearTarget = field(default_factory=CollinearTarget)
    anchor_mm: Array = field(default_factory=lambda: np.array([0.0, -120.0, 1000.0]))
    projector_mm: Array = field(default_factory=lambda: np.zeros(3))
    depth_mm: tuple[float, float] = (900.0, 1300.0)


def paper_rig(
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
    target: CollinearTarget | None = None,
) -> SimulatedRig:
    """The paper's rig: its Table 1 camera, its sheet of light (section 4.1.2), a 400 mm target.

    The projector stands 620 mm from the camera (section 4.2.1), beside it: in the sheet, and
    as near to the camera's own Z = 0 plane as that distance allows.
    """
    camera = Camera((1392, 1040), 2298.711, 2288.767, 689.341, 537.903, distortion=distortion)
    plane = LightPlane(np.array([0.90980, 0.08722, 0.40578]), 562.334)
    return SimulatedRig(
        camera=camera,
        light_plane=plane,
        target=target or CollinearTarget(),
        projector_mm=_beside_camera(plane, 620.0),
    )


def _beside_camera(plane: LightPlane, distance_mm: float) -> Array:
    """The point of the sheet at a given distance from the camera, with the smallest |Z|
    on the camera's side of the field."""
    foot = plane.normal * plane.distance_mm
    sideways = np.cross(plane.normal, [0.0, 1.0, 0.0])
    sideways /= np.linalg.norm(sideways)
    if sideways[2] > 0:
        sideways = -sideways
    reach = np.sqrt(max(distance_mm**2 - plane.distance_mm**2, 0.0))
    return foot + reach * sideways
