"""One lens model in the terms of another: the closest over the whole picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera

LARGEST_MISFIT_PX = 0.5
"""A camera that is farther from the one in the file is another camera."""

_EXACT_PX = 1e-9
"""Below this a difference of two models is rounding, and no coefficient is fitted to it."""

_STEPS = 33
"""As many each way: a picture and its transpose are then matched alike."""


def picture_grid(image_size: tuple[int, int]) -> Array:
    """Image points ``(P, 2)`` over the whole picture, its outermost edges among them, px."""
    sides = [np.linspace(-0.5, n - 0.5, _STEPS) for n in image_size]
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)


def fitted_brown(
    pinhole: Camera, rays_xy: Array, free: Sequence[int] = range(5)
) -> tuple[Camera, float]:
    """The camera with Brown's distortion that comes closest to given rays.

    The distorted coordinates are linear in the coefficients, so this is one linear least-squares
    problem: the squared distances in px between the image points of the rays and the grid.

    Parameters
    ----------
    pinhole : Camera
        Size, focal lengths and principal point, which are kept.
    rays_xy : (P, 2) array
        x and y at z = 1 of the rays through `picture_grid`, by the other model.
    free : sequence of int
        Places in (k1, k2, p1, p2, k3) of those to fit; the others are zero.

    Returns
    -------
    camera : Camera
    misfit : float
        Largest distance in px between the two models over the picture.

    Raises
    ------
    InputError
        If the misfit exceeds 0.5 px, or the coefficients are no finite numbers.
    """
    grid = picture_grid(pinhole.image_size)
    straight = replace(pinhole, distortion=(0.0,) * 5)
    with np.errstate(all="ignore"):
        away = grid - straight.pixels_of(rays_xy)
        if not np.isfinite(away).all():
            _refuse(np.nan)
        coefficients = np.zeros(5)
        if np.abs(away).max() > _EXACT_PX:
            coefficients[list(free)] = _least_squares(straight, rays_xy, away, free)
    if not np.isfinite(coefficients).all():
        _refuse(np.nan)
    k1, k2, p1, p2, k3 = coefficients.tolist()
    camera = replace(straight, distortion=(k1, k2, p1, p2, k3))
    return camera, misfit_px(camera, rays_xy)


def _least_squares(camera: Camera, rays_xy: Array, away: Array, free: Sequence[int]) -> Array:
    rays = np.column_stack([rays_xy, np.ones(len(rays_xy))])
    places = [5 + index for index in free]
    columns = camera.project_with_jacobians(rays, places)[2].reshape(-1, len(places))
    scale = np.linalg.norm(columns, axis=0)
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        _refuse(np.nan)
    return np.linalg.lstsq(columns / scale, away.ravel(), rcond=None)[0] / scale


def misfit_px(camera: Camera, rays_xy: Array) -> float:
    """Largest distance in px between a camera's image points of rays and the grid's points.

    Raises
    ------
    InputError
        If it exceeds 0.5 px, or is no number.
    """
    with np.errstate(all="ignore"):
        apart = camera.pixels_of(rays_xy) - picture_grid(camera.image_size)
        largest = float(np.hypot(apart[:, 0], apart[:, 1]).max())
    if not largest <= LARGEST_MISFIT_PX:
        _refuse(largest)
    return largest


def rays_over_picture(camera: Camera) -> Array:
    """x and y at z = 1 ``(P, 2)`` of the rays through `picture_grid`.

    Raises
    ------
    InputError
        If the lens model has no inverse in a part of the picture.
    """
    rays = camera.unproject(picture_grid(camera.image_size))[:, :2]
    if not np.isfinite(rays).all():
        raise InputError(
            "the camera's distortion has no inverse in a part of the picture",
            "calibrate again with image points up to the picture's corners",
        )
    return rays


def _refuse(misfit: float) -> None:
    far = f"misses it by {misfit:.3g} px" if np.isfinite(misfit) else "does not come close to it"
    raise InputError(
        f"the closest camera of the other lens model {far} (limit {LARGEST_MISFIT_PX} px)",
        "choose another format, or calibrate with fewer distortion coefficients",
    )
