"""What stands before the camera: flat surfaces, and what is painted on them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.paint import Disc, Paint, Quadrants
from sheetoflight.simulation.rig import SimulatedRig

WHITE = 1.0
INK = 0.05
WALL = 0.25
"""Diffuse reflectances, relative to white paint."""

_SMALLEST_SINE = 1e-6


@dataclass(frozen=True)
class Surface:
    """A flat rectangle in space, matt on both sides.

    Parameters
    ----------
    centre : (3,) array
        Its middle in the camera frame, mm.
    axes : (2, 3) array
        Unit vectors along its length and its width, at right angles.
    half_length, half_width : float
        Half of its size along each axis, mm.
    reflectance : float
        Diffuse reflectance, white paint being 1.
    paint : tuple of Paint
        Shapes painted on it, later ones over earlier ones.
    exact : bool
        Whether its edges and its paint are sampled finely, as what is measured must be;
        a backdrop need not.

    Raises
    ------
    InputError
        If the axes are not orthonormal or a size is not positive.
    """

    centre: Array
    axes: Array
    half_length: float
    half_width: float
    reflectance: float = WHITE
    paint: tuple[Paint, ...] = ()
    exact: bool = True

    def __post_init__(self) -> None:
        centre = np.array(self.centre, dtype=float)
        axes = np.array(self.axes, dtype=float)
        if centre.shape != (3,) or axes.shape != (2, 3):
            raise InputError(
                f"a surface has a centre of shape {centre.shape} and axes of shape {axes.shape}",
                "give a centre (3,) and axes (2, 3)",
            )
        if not np.abs(axes @ axes.T - np.eye(2)).max() < 1e-9:
            raise InputError(
                f"the axes of a surface are {axes.tolist()}",
                "give two unit vectors at right angles",
            )
        if not (self.half_length > 0 and self.half_width > 0):
            raise InputError(
                f"a surface measures {self.half_length} × {self.half_width} mm from its middle",
                "give sizes above zero",
            )
        object.__setattr__(self, "centre", centre)
        object.__setattr__(self, "axes", axes)

    @cached_property
    def plane(self) -> tuple[Array, float]:
        """Unit normal ``n`` (away from the camera) and ``d >= 0`` of its plane ``n · X = d``."""
        normal = np.cross(*self.axes)
        distance = float(normal @ self.centre)
        return (normal, distance) if distance >= 0 else (-normal, -distance)

    @cached_property
    def paint_extents(self) -> tuple[Array, Array]:
        """Lowest and highest corner ``(N, 2)`` of a box around each shape painted on it, mm."""
        middles = np.array([(p.a, p.b) for p in self.paint]).reshape(-1, 2)
        reaches = np.array([[p.reach] for p in self.paint]).reshape(-1, 1)
        return middles - reaches, middles + reaches


@dataclass(frozen=True)
class Scene:
    """Surfaces that do not cut through each other, in any order.

    Parameters
    ----------
    surfaces : tuple of Surface
    background : float
        Reflectance seen where no surface is.
    """

    surfaces: tuple[Surface, ...] = field(default_factory=tuple)
    background: float = 0.0


def strip_axes(direction: Array, facing: Array) -> Array:
    """Axes ``(2, 3)`` of a strip along `direction`, turned about it to face `facing`.

    Raises
    ------
    InputError
        If the strip would have to face along its own length.
    """
    along = normalised(np.asarray(direction, dtype=float))
    across = np.cross(along, normalised(np.asarray(facing, dtype=float)))
    sine = float(np.linalg.norm(across))
    if not sine > _SMALLEST_SINE:
        raise InputError(
            "a strip cannot face along its own length", "give another facing direction"
        )
    return np.stack([along, across / sine])


def facing_direction(rig: SimulatedRig, point: Array, laser: bool) -> Array:
    """Direction a strip at `point` faces: the camera, or midway between camera and projector."""
    to_camera = normalised(-np.asarray(point, dtype=float))
    if not laser:
        return to_camera
    return normalised(to_camera + normalised(rig.projector_mm - point))


def target_surface(
    target: CollinearTarget, origin: Array, direction: Array, facing: Array, ink: float = INK
) -> Surface:
    """A white strip with the target's markers; their centres are ``origin + s·direction``.

    Parameters
    ----------
    target : CollinearTarget
    origin : (3,) array
        Marker 0 in the camera frame, mm.
    direction : (3,) array
        Unit vector along the target.
    facing : (3,) array
        Direction the strip is turned towards about its own axis.
    ink : float
        Reflectance of the black parts.

    Returns
    -------
    Surface
        Two marker sizes high, one marker size longer than the markers' centres at each end.
    """
    size, middle = target.marker_size_mm, target.length_mm / 2
    axes = strip_axes(direction, facing)
    paint: list[Paint] = []
    for number, position in enumerate(target.markers_mm):
        if target.marker == "disc":
            paint.append(Disc(position - middle, 0.0, size / 2, ink))
        else:
            paint.append(Quadrants(position - middle, 0.0, size / 2, ink, along=number == 0))
    return Surface(
        centre=np.asarray(origin, dtype=float) + middle * axes[0],
        axes=axes,
        half_length=middle + size,
        half_width=size,
        paint=tuple(paint),
    )


def bar_surface(ends: Array, facing: Array, width_mm: float = 30.0) -> Surface:
    """A plain white bar with square-cut ends at ``ends`` ``(2, 3)``, mm, turned to `facing`."""
    ends = np.asarray(ends, dtype=float)
    span = ends[1] - ends[0]
    return Surface(
        centre=ends.mean(axis=0),
        axes=strip_axes(span, facing),
        half_length=float(np.linalg.norm(span)) / 2,
        half_width=width_mm / 2,
    )


def wall_surface(
    rig: SimulatedRig, distance_mm: float, paint: tuple[Paint, ...] = (), turn: float = 0.15
) -> Surface:
    """A grey wall that fills the picture.

    Parameters
    ----------
    rig : SimulatedRig
    distance_mm : float
        Z of its middle, mm.
    paint : tuple of Paint
        What is painted on it.
    turn : float
        Angle about the camera's y axis from square to the optical axis, radians.
    """
    camera = rig.camera
    sizes = np.array(camera.image_size) / (camera.alpha, camera.beta) * distance_mm
    return Surface(
        centre=np.array([0.0, 0.0, distance_mm]),
        axes=np.array([[math.cos(turn), 0.0, math.sin(turn)], [0.0, 1.0, 0.0]]),
        half_length=float(sizes[0]) * 1.5,
        half_width=float(sizes[1]) * 1.5,
        reflectance=WALL,
        paint=paint,
        exact=False,
    )
