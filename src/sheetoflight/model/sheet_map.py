"""A sheet of light as its picture shows it: the metric homography, without a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class SheetMap:
    """From image points on the laser line to points in the sheet of light.

    With ``p = (uv − centre)/scale`` and the vanishing line ``l1 p_x + l2 p_y + 1 = 0``::

        q = p / (1 + l1 p_x + l2 p_y)      x = a q_x + b q_y,  y = c q_y

    The sheet's frame is chosen: its origin is seen at the picture's centre, its x axis where the
    image's u axis leads from there. Lengths do not depend on that.

    Parameters
    ----------
    image_size : (int, int)
        Width and height in px.
    a, b, c : float
        mm; a and c are positive.
    l1, l2 : float
        The vanishing line, per half diagonal of the picture.
    name : str
        The laser's name.

    Raises
    ------
    InputError
        If a number is not finite, or the map turns the sheet over.
    """

    image_size: tuple[int, int]
    a: float
    b: float
    c: float
    l1: float
    l2: float
    name: str = "laser"

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.parameters)) or self.a <= 0 or self.c == 0:
            raise InputError(
                f"the sheet map of '{self.name}' is {self.parameters.tolist()}",
                "give finite a, b, c, l1, l2 with a above zero and c not zero",
            )

    @cached_property
    def parameters(self) -> Array:
        """``(a, b, c, l1, l2)``."""
        return np.array([self.a, self.b, self.c, self.l1, self.l2])

    @property
    def centre(self) -> Array:
        """The picture's centre, px."""
        return 0.5 * (np.array(self.image_size) - 1.0)

    @property
    def scale(self) -> float:
        """Half the picture's diagonal, px."""
        return 0.5 * float(np.hypot(*self.image_size))

    def points(self, uv: Array) -> Array:
        """Points ``(..., 3)`` in the sheet's own frame, mm, z being 0, of image points
        ``(..., 2)``; NaN beyond the vanishing line."""
        return self.points_with_jacobians(np.asarray(uv, dtype=float))[0]

    def points_with_jacobians(self, uv: Array) -> tuple[Array, Array, Array]:
        """`points`, and their derivatives.

        Returns
        -------
        xyz : (..., 3) mm
        by_pixel : (..., 3, 2) mm per px
        by_parameter : (..., 3, 5) mm per unit of `parameters`
        """
        p = (uv - self.centre) / self.scale
        line = np.array([self.l1, self.l2])
        depth = 1.0 + p @ line
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(depth > 0, 1.0 / depth, np.nan)[..., None]
        q = p * inverse
        upper = np.array([[self.a, self.b], [0.0, self.c]])
        xy = q @ upper.T
        q_by_p = inverse[..., None] * (np.eye(2) - q[..., :, None] * line)
        by_pixel = np.zeros((*p.shape[:-1], 3, 2))
        by_pixel[..., :2, :] = upper @ q_by_p / self.scale
        by_parameter = np.zeros((*p.shape[:-1], 3, 5))
        by_parameter[..., 0, 0] = q[..., 0]
        by_parameter[..., 0, 1] = q[..., 1]
        by_parameter[..., 1, 2] = q[..., 1]
        by_parameter[..., :2, 3:] = -xy[..., :, None] * q[..., None, :]
        xyz = np.concatenate([xy, np.where(np.isfinite(xy[..., :1]), 0.0, np.nan)], axis=-1)
        return xyz, by_pixel, by_parameter

    def image_with_jacobians(self, xy: Array) -> tuple[Array, Array, Array]:
        """Image points of points ``(..., 2)`` in the sheet, and their derivatives.

        Returns
        -------
        uv : (..., 2) px
        by_point : (..., 2, 2) px per mm
        by_parameter : (..., 2, 5) px per unit of `parameters`
        """
        upper = np.array([[self.a, self.b], [0.0, self.c]])
        back = np.linalg.inv(upper)
        line = np.array([self.l1, self.l2])
        q = xy @ back.T
        depth = 1.0 - q @ line
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(depth > 0, 1.0 / depth, np.nan)[..., None]
        p = q * inverse
        p_by_q = inverse[..., None] * (np.eye(2) + p[..., :, None] * line)
        by_point = self.scale * p_by_q @ back
        by_parameter = np.empty((*p.shape[:-1], 2, 5))
        moved = np.zeros((*p.shape[:-1], 2, 3))  # how U q moves with a, b, c
        moved[..., 0, 0] = q[..., 0]
        moved[..., 0, 1] = moved[..., 1, 2] = q[..., 1]
        by_parameter[..., :3] = -by_point @ moved
        by_parameter[..., 3:] = self.scale * p[..., :, None] * p[..., None, :]
        return p * self.scale + self.centre, by_point, by_parameter
