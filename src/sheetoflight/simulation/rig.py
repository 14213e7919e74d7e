"""The rig that is simulated: what a calibration should find."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class SimulatedRig:
    """The truth behind simulated observations.

    Parameters
    ----------
    camera : Camera
    light_planes : tuple of LightPlane
        The sheets of light, one of each laser.
    target : CollinearTarget
    anchor_mm : (3,) array
        Where marker 0 is fixed while the target pivots, camera frame.
    projector_mm : (3,) array
        Where the line projector of the first laser stands, in its sheet of light.
    depth_mm : (float, float)
        Nearest and farthest Z of targets and objects in a sheet.
    board : PlanarBoard or SolidTarget, optional
        What is held across the sheets in stage board.

    Raises
    ------
    InputError
        If there is no sheet of light, or two have one name.
    """

    camera: Camera
    light_planes: tuple[LightPlane, ...]
    target: CollinearTarget = field(default_factory=CollinearTarget)
    anchor_mm: Array = field(default_factory=lambda: np.array([0.0, -120.0, 1000.0]))
    projector_mm: Array = field(default_factory=lambda: np.zeros(3))
    depth_mm: tuple[float, float] = (900.0, 1300.0)
    board: Board | None = None

    def __post_init__(self) -> None:
        names = [plane.name for plane in self.light_planes]
        if not names or len(set(names)) != len(names):
            raise InputError(
                f"the sheets of light are called {names}",
                "give at least one, and each a name of its own",
            )

    @property
    def light_plane(self) -> LightPlane:
        """The first sheet of light."""
        return self.light_planes[0]


def field_centre(rig: SimulatedRig, laser: int = 0) -> Array:
    """The point ``(3,)`` of a sheet in the middle of `depth_mm` that is nearest to the axis."""
    plane, z = rig.light_planes[laser], sum(rig.depth_mm) / 2
    across = plane.normal[:2]
    return np.append((plane.distance_mm - plane.normal[2] * z) / (across @ across) * across, z)


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
        light_planes=(plane,),
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
