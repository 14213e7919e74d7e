"""The laser line's centres to points in space with their standard uncertainties.

The covariance of a point is ``J_px Σ_px J_pxᵀ + J_cal Σ_cal J_calᵀ``: the picture's noise, which is
each centre's own, across the line, and the calibration, which neighbouring points share.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.triangulation import parameter_names, triangulate_with_jacobians
from sheetoflight.model.calibration import AnyCalibration, Calibration
from sheetoflight.model.lens import CHUNK
from sheetoflight.model.point_cloud import PointCloud
from sheetoflight.model.stripe import Stripe

COMPILED_FROM = 250_000
"""Image points from which on compiled loops are used; what arrays take for fewer is no more than
what it takes to load numba. (To compile the loops, once on a computer, takes some seconds.)"""

_COMPILED_CHUNK = 16384
_ROUNDING = 1e-14
"""Eigenvalues of a correlation matrix up to this are rounding, not variance."""


def reconstruct(
    calibration: AnyCalibration,
    stripes: Stripe | Sequence[tuple[str, Stripe]],
    laser: str | None = None,
) -> PointCloud:
    """Points in space of the centres of the laser line.

    Only good centres count. Those whose ray does not meet the sheet in front of the camera, or
    that lie beyond the part of the picture that the lens model describes, are left out, as are
    those without a finite `std`.

    Parameters
    ----------
    calibration : Calibration or SheetCalibration
        One without covariance gives the picture's noise alone.
    stripes : Stripe, or sequence of (str, Stripe)
        Of each picture its name and the line in it; one without a name is called ``picture``.
    laser : str, optional
        In whose sheet the lines lie; may be left out where there is one laser.

    Returns
    -------
    PointCloud
        In the order of pictures and centres; empty where there is nothing to see.

    Raises
    ------
    InputError
        If a centre lies outside the calibrated picture, or the laser is not known.
    """
    named = [("picture", stripes)] if isinstance(stripes, Stripe) else list(stripes)
    calibration.sheet(laser)
    chosen = [_measurable(name, stripe, calibration.image_size) for name, stripe in named]
    uv, std, across = (
        _joined([getattr(stripe, part) for stripe in chosen], shape)
        for part, shape in (("uv", (0, 2)), ("std", (0,)), ("across", (0, 2)))
    )
    xyz, std_xyz, noise_std = points_with_std(calibration, uv, std, across, laser)
    parts: dict[str, Any] = {
        "xyz": xyz,
        "std_xyz": std_xyz,
        "noise_std": noise_std,
        "uv": uv,
        "peak": _joined([stripe.peak for stripe in chosen], (0,)),
        "line": _joined([stripe.line for stripe in chosen], (0,)).astype(np.int64, copy=False),
        "picture": np.repeat(np.arange(len(chosen)), [len(stripe) for stripe in chosen]),
    }
    met = np.isfinite(xyz[:, 2])
    if not met.all():
        parts = {name: values[met] for name, values in parts.items()}
    return PointCloud(**parts, pictures=tuple(name for name, _ in named))


def _measurable(name: str, stripe: Stripe, image_size: tuple[int, int]) -> Stripe:
    """The centres of one picture that can become points."""
    usable = stripe.good & np.isfinite(stripe.std)
    if not usable.all():
        stripe = stripe.taken(usable)
    width, height = image_size
    if len(stripe):
        # NumPy is slow to reduce a long array of pairs along it; each coordinate alone is quick
        (u, last_u), (v, last_v) = ((axis.min(), axis.max()) for axis in stripe.uv.T)
        if not (u >= -0.5 and v >= -0.5 and last_u <= width - 0.5 and last_v <= height - 0.5):
            raise InputError(
                f"{name}: the line reaches from ({u:g}, {v:g}) to ({last_u:g}, {last_v:g}), "
                f"outside the {width}×{height} picture that was calibrated",
                "give pictures of the calibrated camera, in full size",
            )
    return stripe


def _joined(arrays: list[NDArray[Any]], nothing: tuple[int, ...]) -> NDArray[Any]:
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate(arrays) if arrays else np.zeros(nothing)


def points_with_std(
    calibration: AnyCalibration,
    uv: Array,
    std: Array,
    across: Array,
    laser: str | None = None,
) -> tuple[Array, Array, Array]:
    """Points in space, the standard uncertainties of their coordinates, and the noise's part.

    Parameters
    ----------
    calibration : Calibration or SheetCalibration
    uv : (N, 2) array
        Image points, px.
    std : (N,) array
        Standard uncertainty of each, px, in the direction
    across : (N, 2) array
        of unit length.
    laser : str, optional
        In whose sheet they lie.

    Returns
    -------
    xyz, std_xyz : (N, 3) arrays, noise_std : (N,) array
        mm, as in `PointCloud`; NaN where the ray does not meet the sheet.
    """
    steps = across * np.reshape(std, (-1, 1))
    many = len(uv) >= COMPILED_FROM and find_spec("numba") is not None
    if many and isinstance(calibration, Calibration):
        return _by_compiled_loops(calibration, uv, steps, laser)
    return _by_arrays(calibration, uv, steps, laser)


def _by_arrays(
    calibration: AnyCalibration, uv: Array, steps: Array, laser: str | None
) -> tuple[Array, Array, Array]:
    xyz, std_xyz, noise_std = _nothing(len(uv))
    factor = _factor(calibration, laser)
    for start in range(0, len(uv), CHUNK):
        part = slice(start, start + CHUNK)
        found = triangulate_with_jacobians(calibration, uv[part], laser)
        noise = np.square(found.by_pixel @ steps[part, :, None])[..., 0]
        common = np.sum(np.square(found.by_parameter @ factor), axis=-1)
        xyz[part] = found.xyz
        std_xyz[part] = np.sqrt(noise + common)
        noise_std[part] = np.sqrt(noise.sum(axis=-1))
    return xyz, std_xyz, noise_std


def _by_compiled_loops(
    calibration: Calibration, uv: Array, steps: Array, laser: str | None
) -> tuple[Array, Array, Array]:
    from sheetoflight.measurement.point_loops import fill_points, rows_of, sheet_of

    camera, plane = calibration.camera, calibration.sheet(laser)
    rows = rows_of(_factor(calibration, laser), camera.alpha, camera.beta)
    known = tuple(camera.parameters.tolist()), sheet_of(plane), rows
    found = _nothing(len(uv))

    def work(first: int) -> None:
        last = min(first + _COMPILED_CHUNK, len(uv))
        fill_points(uv, steps, first, last, *known, *found)

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        list(pool.map(work, range(0, len(uv), _COMPILED_CHUNK)))
    return found


def _nothing(count: int) -> tuple[Array, Array, Array]:
    return np.empty((count, 3)), np.empty((count, 3)), np.empty(count)


def _factor(calibration: AnyCalibration, laser: str | None) -> Array:
    """``L`` of shape (P, R), R the rank, with ``L Lᵀ`` the covariance of camera and sheet.

    From the eigenvalues of the correlation matrix, so that the parameters' units do not matter.
    """
    covariance = calibration.covariance.block(parameter_names(calibration.sheet(laser)))
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(std > 0, std, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    kept = values > _ROUNDING
    return std[:, None] * vectors[:, kept] * np.sqrt(values[kept])
