"""What is known of a rig before any picture is taken: from its drawing, or from a tape measure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane

LEAST_ANGLE_DEG = 1.0
"""A flatter sheet is seen edge on by the middle of the picture."""

_DEPTH_SHARE = 0.2
"""Depths that are assumed where none are stated: up to this share before and behind the distance
at which the sheets cross the optical axis."""


@dataclass(frozen=True)
class SheetGeometry:
    """How a sheet of light stands to the camera.

    Parameters
    ----------
    angle_deg : float
        Between the sheet and the optical axis: 90 for a sheet that the camera faces.
    roll_deg : float
        On which side of the camera the sheet comes in, clockwise in the picture: 0 from the
        right (its lines of equal depth are vertical in the picture), 90 from below.
    distance_mm : float
        From the camera to where the sheet crosses the optical axis.

    Raises
    ------
    InputError
        If the sheet would be seen edge on, or cross the axis behind the camera.
    """

    angle_deg: float
    roll_deg: float
    distance_mm: float

    def __post_init__(self) -> None:
        if not LEAST_ANGLE_DEG <= self.angle_deg <= 90:
            raise InputError(
                f"sheet_angle_deg is {self.angle_deg:g}",
                f"give the angle between sheet and optical axis, {LEAST_ANGLE_DEG:g} to 90",
            )
        if not math.isfinite(self.roll_deg):
            raise InputError(f"sheet_roll_deg is {self.roll_deg}", "give degrees, 0 to 360")
        if not (math.isfinite(self.distance_mm) and self.distance_mm > 0):
            raise InputError(
                f"working_distance_mm is {self.distance_mm}", "give a distance above zero"
            )

    def light_plane(self, name: str) -> LightPlane:
        """The sheet in the camera frame.

        Examples
        --------
        >>> plane = SheetGeometry(30.0, 0.0, 1000.0).light_plane("laser")
        >>> [round(float(c), 3) for c in plane.normal], round(plane.distance_mm, 3)
        ([0.866, 0.0, 0.5], 500.0)
        """
        angle, roll = math.radians(self.angle_deg), math.radians(self.roll_deg)
        across = math.cos(angle)
        normal = np.array([across * math.cos(roll), across * math.sin(roll), math.sin(angle)])
        return LightPlane(normal, math.sin(angle) * self.distance_mm, name)


@dataclass(frozen=True)
class NominalGeometry:
    """A rig in the numbers of its drawing.

    Parameters
    ----------
    focal_px : float
    sheets : tuple of SheetGeometry
        One for each laser.
    depth_mm : (float, float), optional
        Nearest and farthest Z at which targets lie in the sheets and lengths are measured.
    pivot_mm : (3,) tuple, optional
        Where marker 0 is fixed while the target pivots, camera frame.

    Raises
    ------
    InputError
        If a number cannot be, or two lasers have one sheet.
    """

    focal_px: float
    sheets: tuple[SheetGeometry, ...]
    depth_mm: tuple[float, float] | None = None
    pivot_mm: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.focal_px) and self.focal_px > 0):
            raise InputError(f"the focal length is {self.focal_px} px", "give a value above zero")
        if len(set(self.sheets)) < len(self.sheets):
            raise InputError(
                "two lasers have the same sheet of light",
                "give each [[laser]] its own sheet_angle_deg, sheet_roll_deg or "
                "working_distance_mm",
            )
        if self.depth_mm is not None and not 0 < self.depth_mm[0] < self.depth_mm[1]:
            raise InputError(
                f"depth_mm is {list(self.depth_mm)}", "give the nearest depth, then the farthest"
            )
        if self.pivot_mm is not None and not self.pivot_mm[2] > 0:
            raise InputError(
                f"pivot_mm is {list(self.pivot_mm)}", "give a point in front of the camera, z > 0"
            )


@dataclass(frozen=True, eq=False)
class NominalRig:
    """A rig as a plan takes it to be.

    Parameters
    ----------
    camera : Camera
    light_planes : tuple of LightPlane
    pivot_mm : (3,) array
        Where marker 0 is fixed while the target pivots, camera frame.
    depth_mm : (float, float)
        Nearest and farthest Z at which targets lie in the sheets and lengths are measured.
    assumptions : tuple of str
        What was not stated and had to be taken from somewhere.

    Raises
    ------
    InputError
        If a sheet of light is curved.
    """

    camera: Camera
    light_planes: tuple[LightPlane, ...]
    pivot_mm: Array
    depth_mm: tuple[float, float]
    assumptions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for plane in self.light_planes:
            if plane.curvature is not None:
                raise InputError(
                    f"the sheet of light '{plane.name}' is curved; plans are of flat ones",
                    "plan with a calibration of flat sheets, or from a drawing",
                )


def nominal_rig(
    geometry: NominalGeometry, image_size: tuple[int, int], lasers: tuple[str, ...]
) -> NominalRig:
    """The rig of a drawing: square pixels, no distortion, principal point in the middle.

    Parameters
    ----------
    geometry : NominalGeometry
    image_size : (int, int)
        Width and height, px.
    lasers : tuple of str
        Names of the sheets.
    """
    width, height = image_size
    focal = geometry.focal_px
    camera = Camera(image_size, focal, focal, (width - 1) / 2, (height - 1) / 2)
    planes = tuple(
        sheet.light_plane(name) for sheet, name in zip(geometry.sheets, lasers, strict=True)
    )
    distance = sum(sheet.distance_mm for sheet in geometry.sheets) / len(geometry.sheets)
    pivot, depth, assumed = completed(geometry.pivot_mm, geometry.depth_mm, distance)
    lens = "square pixels, principal point in the picture's middle, no distortion"
    return NominalRig(camera, planes, pivot, depth, (lens, *assumed))


def completed(
    pivot_mm: tuple[float, float, float] | None,
    depth_mm: tuple[float, float] | None,
    distance_mm: float,
) -> tuple[Array, tuple[float, float], tuple[str, ...]]:
    """Pivot and depths, assumed where not stated; and the assumptions in words.

    Parameters
    ----------
    pivot_mm, depth_mm
        As stated, or None.
    distance_mm : float
        At which the sheets cross the optical axis.
    """
    assumed = []
    if pivot_mm is None:
        pivot_mm = (0.0, 0.0, distance_mm)
        assumed.append(f"no pivot_mm: marker 0 pivots on the optical axis at {distance_mm:.0f} mm")
    if depth_mm is None:
        depth_mm = ((1 - _DEPTH_SHARE) * distance_mm, (1 + _DEPTH_SHARE) * distance_mm)
        assumed.append(f"no depth_mm: depths from {depth_mm[0]:.0f} to {depth_mm[1]:.0f} mm")
    return np.array(pivot_mm, dtype=float), depth_mm, tuple(assumed)
