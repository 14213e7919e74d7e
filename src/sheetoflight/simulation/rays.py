"""The camera's rays on its pixel grid, found from the projection alone.

The renderer must not rest on the camera's own inverse, or a test of that inverse against
rendered pictures would be a circle. Newton's iteration on `Camera.pixels_of`, with
differences for its Jacobian, gives an independent one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera

_DIFFERENCE = 1e-5
_NEWTON_STEPS = 40
_CONVERGED_PX = 1e-8
_NODE_PX = 8


@dataclass(frozen=True)
class RayGrid:
    """Rays ``(x, y, 1)`` through all pixel centres of a picture and a border around it.

    Parameters
    ----------
    x, y : (height + 2 border, width + 2 border) arrays
        Ideal normalised image coordinates.
    border : int
        Pixels beyond the picture's edge on each side.
    """

    x: Array
    y: Array
    border: int

    def block(self, rows: range, columns: range) -> tuple[Array, Array]:
        """x and y at the given pixels; indices may reach into the border."""
        window = np.s_[
            rows.start + self.border : rows.stop + self.border,
            columns.start + self.border : columns.stop + self.border,
        ]
        return self.x[window], self.y[window]


@lru_cache(maxsize=4)
def ray_grid(camera: Camera, border: int) -> RayGrid:
    """Rays of a camera on its pixel grid and `border` pixels beyond, kept for the next call.

    Raises
    ------
    InputError
        If the lens distortion has no inverse over the whole picture.
    """
    width, height = camera.image_size
    u, v = np.arange(-border, width + border), np.arange(-border, height + border)
    node_u, node_v = _nodes(u), _nodes(v)
    rays = _inverted(camera, np.stack(np.meshgrid(node_u, node_v), axis=-1))
    x, y = (RectBivariateSpline(node_v, node_u, rays[..., i])(v, u) for i in range(2))
    x.setflags(write=False)
    y.setflags(write=False)
    return RayGrid(x, y, border)


def _nodes(pixels: NDArray[np.int_]) -> Array:
    """Pixel coordinates at which the lens is inverted: its distortion is smooth between."""
    count = max(4, 2 + len(pixels) // _NODE_PX)
    return np.linspace(pixels[0], pixels[-1], count)


def _inverted(camera: Camera, uv: Array) -> Array:
    """Normalised coordinates ``(..., 2)`` whose image is ``uv``, by Newton's iteration."""
    offset = camera.pixels_of(np.zeros(2))
    along_x, along_y = _derivatives(camera, np.zeros(2))
    normal_xy = (uv - offset) @ np.linalg.inv(np.column_stack([along_x, along_y])).T
    for _ in range(_NEWTON_STEPS):
        miss = camera.pixels_of(normal_xy) - uv
        along_x, along_y = _derivatives(camera, normal_xy)
        determinant = along_x[..., 0] * along_y[..., 1] - along_x[..., 1] * along_y[..., 0]
        if not (np.isfinite(miss).all() and determinant.min() > 0):
            break
        if np.abs(miss).max() < _CONVERGED_PX:
            return normal_xy
        step_x = miss[..., 0] * along_y[..., 1] - miss[..., 1] * along_y[..., 0]
        step_y = along_x[..., 0] * miss[..., 1] - along_x[..., 1] * miss[..., 0]
        normal_xy = normal_xy - np.stack([step_x, step_y], axis=-1) / determinant[..., None]
    raise InputError(
        f"the lens distortion {list(camera.distortion)} has no inverse over the whole picture",
        "use weaker coefficients, or a smaller picture",
    )


def _derivatives(camera: Camera, normal_xy: Array) -> tuple[Array, Array]:
    """Change of the image point per unit of x, and per unit of y, ``(..., 2)`` px each."""
    steps = np.eye(2) * _DIFFERENCE
    along_x, along_y = (
        (camera.pixels_of(normal_xy + step) - camera.pixels_of(normal_xy - step))
        / (2 * _DIFFERENCE)
        for step in steps
    )
    return along_x, along_y
