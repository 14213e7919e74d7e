"""HALCON's two lens models for area scan cameras, and the closest camera of Brown's model.

Both lead from the picture to the ideal image plane in closed form, the way opposite to Brown's.
With ``(u, v) = ((column − Cx) Sx, (row − Cy) Sy)`` in metres and ``r² = u² + v²`` the ideal point
``(ũ, ṽ)`` is, by the chapter Calibration of HALCON's operator reference::

    division      ũ = u / (1 + κ r²)                                  (ṽ alike)
    polynomial    ũ = u (1 + K1 r² + K2 r⁴ + K3 r⁶) + P1 (r² + 2 u²) + 2 P2 u v
                  ṽ = v (1 + K1 r² + K2 r⁴ + K3 r⁶) + 2 P1 u v + P2 (r² + 2 v²)

and the ray through it ``(ũ, ṽ, Focus)``. Solved for u, the first is
``u = 2 ũ / (1 + √(1 − 4 κ r̃²))``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.exchange.lens_fit import (
    fitted_brown,
    misfit_px,
    picture_grid,
    rays_over_picture,
)
from sheetoflight.model.camera import Camera

_METRES_PER_UM = 1e-6

_GOOD_PX = 0.01
"""Where the division model comes this close, it is preferred for having one coefficient."""

_POWERS = {1: (2,), 5: (2, 4, 6, 1, 1)}
"""Powers of a length in metres that the coefficients' units are one over: κ; K1, K2, K3, P1, P2."""


@dataclass(frozen=True)
class HalconCamera:
    """Interior parameters of an area scan camera, in HALCON's letters and units.

    Parameters
    ----------
    focus : float
        Focal length, m.
    coefficients : tuple of float
        (κ,) of the division model in 1/m², or (K1, K2, K3, P1, P2) of the polynomial model in
        1/m², 1/m⁴, 1/m⁶, 1/m, 1/m.
    sx, sy : float
        Distance between the centres of neighbouring pixels along columns and rows, m.
    cx, cy : float
        Column and row of the principal point, px; (0, 0) is the centre of the first pixel.
    image_size : (int, int)
        Width and height, px.

    Raises
    ------
    InputError
        If a value is not finite, or one that must be above zero is not.
    """

    focus: float
    coefficients: tuple[float, ...]
    sx: float
    sy: float
    cx: float
    cy: float
    image_size: tuple[int, int]

    def __post_init__(self) -> None:
        values = (self.focus, *self.coefficients, self.sx, self.sy, self.cx, self.cy)
        if not np.isfinite(values).all() or min(self.focus, self.sx, self.sy) <= 0:
            raise InputError(
                f"Focus is {self.focus:g} m, Sx and Sy are {self.sx:g} and {self.sy:g} m",
                "all must be above zero; telecentric cameras have no place here",
            )

    def rays_xy(self) -> Array:
        """x and y at z = 1 ``(P, 2)`` of the rays through `picture_grid`."""
        u, v = self._on_sensor()
        with np.errstate(all="ignore"):
            ideal = _ideal(self.coefficients, u, v)
        return np.stack(ideal, axis=-1) / self.focus

    def _on_sensor(self) -> tuple[Array, Array]:
        """The points of `picture_grid` in metres from the principal point."""
        column, row = picture_grid(self.image_size).T
        return (column - self.cx) * self.sx, (row - self.cy) * self.sy


def _ideal(coefficients: Sequence[float], u: Array, v: Array) -> tuple[Array, Array]:
    r2 = u * u + v * v
    if len(coefficients) == 1:
        factor = 1.0 + coefficients[0] * r2
        factor = np.where(factor > 0, factor, np.nan)
        return u / factor, v / factor
    k1, k2, k3, p1, p2 = coefficients
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        u * radial + p1 * (r2 + 2.0 * u * u) + 2.0 * p2 * u * v,
        v * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * v * v),
    )


def camera_from_halcon(halcon: HalconCamera) -> tuple[Camera, float]:
    """The closest camera of Brown's model, and how far it is at most, px.

    ``alpha = Focus / Sx``, ``beta = Focus / Sy``, ``u0 = Cx``, ``v0 = Cy`` are kept; the division
    model bends rays alike all around, so that it is matched without p1 and p2.

    Raises
    ------
    InputError
        If the two are farther apart than 0.5 px somewhere in the picture.
    """
    pinhole = Camera(
        halcon.image_size, halcon.focus / halcon.sx, halcon.focus / halcon.sy, halcon.cx, halcon.cy
    )
    free = (0, 1, 4) if len(halcon.coefficients) == 1 else range(5)
    return fitted_brown(pinhole, halcon.rays_xy(), free)


def halcon_from_camera(camera: Camera, pixel_um: float) -> tuple[HalconCamera, float]:
    """The closest camera of HALCON's models, and how far it is at most, px.

    The division model where that comes within 0.01 px or closer than the polynomial, which has
    four coefficients more.

    Parameters
    ----------
    camera : Camera
    pixel_um : float
        Width of a pixel in µm: the camera itself determines only Focus / Sx.

    Raises
    ------
    InputError
        If neither model comes within 0.5 px over the picture, or `pixel_um` is not above zero.
    """
    if not (np.isfinite(pixel_um) and pixel_um > 0):
        raise InputError(f"pixel_um is {pixel_um}", "give the width of a pixel in µm")
    if not (camera.distorts or camera.gamma):
        return _pinhole(camera, pixel_um, 1), 0.0
    rays = rays_over_picture(camera)
    halcon, misfit = _closest(camera, rays, pixel_um, 1)
    if not misfit <= _GOOD_PX:
        polynomial, other = _closest(camera, rays, pixel_um, 5)
        halcon = polynomial if other < misfit else halcon
    return halcon, misfit_px(camera, halcon.rays_xy())


def _pinhole(camera: Camera, pixel_um: float, count: int) -> HalconCamera:
    """The camera without skew and distortion, with so many coefficients of zero."""
    sx = pixel_um * _METRES_PER_UM
    focus = camera.alpha * sx
    sy = focus / camera.beta
    return HalconCamera(focus, (0.0,) * count, sx, sy, camera.u0, camera.v0, camera.image_size)


def _closest(
    camera: Camera, rays_xy: Array, pixel_um: float, count: int
) -> tuple[HalconCamera, float]:
    """The camera with so many coefficients whose rays through the grid project closest to it."""
    from scipy.optimize import least_squares

    plain = _pinhole(camera, pixel_um, count)
    focus = plain.focus
    u, v = plain._on_sensor()
    size = float(np.hypot(u, v).max())
    units = size ** -np.array(_POWERS[count], dtype=float)
    grid = picture_grid(camera.image_size)

    def apart(scaled: Array) -> Array:
        ideal = _ideal((scaled * units).tolist(), u, v)
        return (camera.pixels_of(np.stack(ideal, axis=-1) / focus) - grid).ravel()

    start = _linear_start(rays_xy * focus, u, v, units)
    with np.errstate(all="ignore"):
        if not np.isfinite(apart(start)).all():
            return plain, np.inf
        found = least_squares(apart, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        misfit = float(np.hypot(*apart(found).reshape(-1, 2).T).max())
    return replace(plain, coefficients=tuple((found * units).tolist())), misfit


def _linear_start(ideal: Array, u: Array, v: Array, units: Array) -> Array:
    """Coefficients over `units` that fit the ideal points ``(P, 2)``, in which they are linear."""
    if len(units) == 1:
        columns = ideal * (units[0] * (u * u + v * v))[:, None]
        away = np.stack([u, v], axis=-1) - ideal
        return np.array([float(np.sum(columns * away) / np.sum(columns * columns))])
    straight = np.stack([u, v], axis=-1)
    columns = [
        (np.stack(_ideal(row, u, v), axis=-1) - straight).ravel() for row in np.diag(units).tolist()
    ]
    return np.linalg.lstsq(np.stack(columns, axis=-1), (ideal - straight).ravel(), rcond=None)[0]
