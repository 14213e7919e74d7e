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
from sheetoflight.simulation.light_cone import LightCone


@dataclass(frozen=True)
class SimulatedRig:
    """The truth behind simulated observations.

    Parameters
    ----------
    camera : Camera
    light_planes : tuple of LightPlane
        The sheets of light, one of each laser; flat or curved.
    target : CollinearTarget
    anchor_mm : (3,) array
        Where marker 0 is fixed while the target pivots, camera frame.
    projector_mm : (3,) array
        Where the line projector of the first laser stands, in its sheet of light.
    depth_mm : (float, float)
        Nearest and farthest Z of targets and objects in a sheet.
    board : PlanarBoard or SolidTarget, optional
        What is held across the sheets in stage board.
    cones : tuple of (LightCone or None)
        Of each laser whose light is a true cone, that; its `light_planes` is then no more than
        the plane near which lines on boards are sought. Empty where there is none.

    Raises
    ------
    InputError
        If there is no sheet of light, two have one name, or not every laser has its cone or None.
    """

    camera: Camera
    light_planes: tuple[LightPlane, ...]
    target: CollinearTarget = field(default_factory=CollinearTarget)
    anchor_mm: Array = field(default_factory=lambda: np.array([0.0, -120.0, 1000.0]))
    projector_mm: Array = field(default_factory=lambda: np.zeros(3))
    depth_mm: tuple[float, float] = (900.0, 1300.0)
    board: Board | None = None
    cones: tuple[LightCone | None, ...] = ()

    def __post_init__(self) -> None:
        names = [plane.name for plane in self.light_planes]
        if not names or len(set(names)) != len(names):
            raise InputError(
                f"the sheets of light are called {names}",
                "give at least one, and each a name of its own",
            )
        if self.cones and len(self.cones) != len(names):
            raise InputError(
                f"{len(names)} sheets of light have {len(self.cones)} cones",
                "give a cone or None for each, or none at all",
            )

    @property
    def light_plane(self) -> LightPlane:
        """The first sheet of light."""
        return self.light_planes[0]

    def surface(self, laser: int) -> LightPlane | LightCone:
        """What the light of a laser really is."""
        cone = self.cones[laser] if self.cones else None
        return self.light_planes[laser] if cone is None else cone

    def flat_sheet(self, laser: int, what: str) -> LightPlane:
        """The sheet of a laser where only a flat one will do.

        Raises
        ------
        InputError
            If it is curved; `what` says what wants it flat.
        """
        if not self.is_flat(laser):
            raise InputError(
                f"the sheet of light '{self.light_planes[laser].name}' is curved, and {what}",
                "simulate boards or crossing views, or a flat sheet",
            )
        return self.light_planes[laser]

    def heights(self, points: Array, lasers: np.ndarray) -> Array:
        """How far points ``(P, 3)`` lie off the sheets of lasers ``(P,)``, mm."""
        heights = np.empty(len(points))
        for laser in range(len(self.light_planes)):
            own = lasers == laser
            heights[own] = self.surface(laser).heights(points[own])
        return heights

    def is_flat(self, laser: int) -> bool:
        """Whether the light of a laser is a plane."""
        surface = self.surface(laser)
        return isinstance(surface, LightPlane) and surface.curvature is None


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
