"""``Calib_Results.mat`` of Bouguet's Camera Calibration Toolbox for Matlab.

``KK = [[fc1, alpha_c fc1, cc1], [0, fc2, cc2], [0, 0, 1]]``, ``kc = (k1, k2, p1, p2, k3)`` by the
toolbox's page "Description of the calibration parameters"; pixel (0, 0) is the centre of the
first one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.exchange.exchanged import Exchanged, Source, lost_curvature, lost_uncertainty
from sheetoflight.io.exchange.mat_reading import Value, mat_variables, real_numbers
from sheetoflight.io.exchange.mat_writing import mat_bytes
from sheetoflight.io.exchange.values import brown, camera_of, counted_numbers, image_size
from sheetoflight.io.reading import naming
from sheetoflight.model.light_plane import LightPlane

ENDINGS = (".mat",)

_CAMERA = ("fc", "cc", "alpha_c", "kc", "nx", "ny")
_PLANES = ("light_plane_names", "light_plane_normals", "light_plane_distances_mm")
"""Variables of our own: a cell array, ``3 x L``, and ``1 x L``."""


def read(data: bytes, size: tuple[int, int] | None) -> Exchanged:
    """The camera of a ``Calib_Results.mat``.

    Parameters
    ----------
    data : bytes
    size : (int, int), optional
        Width and height of the pictures in px, where the file may not say it.

    Raises
    ------
    FileError
        If the file is damaged or of another version.
    InputError
        If a variable is missing or wrong.
    """
    found = mat_variables(data, (*_CAMERA, *_PLANES))
    notes: tuple[str, ...] = ("errors, poses and corners in it are not held",)
    if "alpha_c" not in found:
        notes += ("no alpha_c in it: the skew is taken as zero",)
    if "kc" not in found:
        notes += ("no kc in it: distortion is taken as zero",)
    fc, cc = _vector(found, "fc", 2), _vector(found, "cc", 2)
    skew = float(_vector(found, "alpha_c", 1)[0]) * fc[0] if "alpha_c" in found else 0.0
    matrix = np.array([fc[0], skew, cc[0], 0.0, fc[1], cc[1], 0.0, 0.0, 1.0])
    distortion = brown(real_numbers(found, "kc").ravel().tolist() if "kc" in found else [], "kc")
    return Exchanged(
        camera=camera_of(_size(found, size), matrix, distortion, "fc, cc, alpha_c"),
        light_planes=_light_planes(found),
        format="bouguet",
        notes=notes,
    )


def written(source: Source) -> tuple[bytes, tuple[str, ...]]:
    """A calibration as ``Calib_Results.mat``, and what is lost."""
    camera = source.camera
    variables = {
        "fc": np.array([[camera.alpha], [camera.beta]]),
        "cc": np.array([[camera.u0], [camera.v0]]),
        "alpha_c": camera.gamma / camera.alpha,
        "kc": np.array(camera.distortion).reshape(5, 1),
        "nx": float(camera.image_size[0]),
        "ny": float(camera.image_size[1]),
        "KK": camera.matrix,
        **(_plane_variables(source.light_planes) if source.light_planes else {}),
    }
    return mat_bytes(variables), lost_curvature(source) + lost_uncertainty(source)


def _plane_variables(planes: Sequence[LightPlane]) -> dict[str, Any]:
    names = np.empty((1, len(planes)), dtype=object)
    names[0, :] = [plane.name for plane in planes]
    normals = np.stack([plane.normal for plane in planes], axis=1)
    distances = np.array([[plane.distance_mm for plane in planes]])
    return dict(zip(_PLANES, (names, normals, distances), strict=True))


def _vector(found: dict[str, Value], name: str, count: int) -> Array:
    return counted_numbers(real_numbers(found, name).ravel().tolist(), name, count)


def _size(found: dict[str, Value], given: tuple[int, int] | None) -> tuple[int, int]:
    if "nx" not in found or "ny" not in found:
        if given is None:
            raise InputError("nx and ny are not in it", "give image_size, in px")
        return given
    sides = [_vector(found, name, 1)[0] for name in ("nx", "ny")]
    size = image_size([float(side) for side in sides], "nx, ny")
    if given not in (None, size):
        raise InputError(f"the pictures are {size} px by the file, {given} were given", "check it")
    return size


def _light_planes(found: dict[str, Value]) -> tuple[LightPlane, ...]:
    if not all(name in found for name in _PLANES):
        return ()
    names = _names(found["light_plane_names"])
    count = len(names)
    normals = counted_numbers(
        real_numbers(found, "light_plane_normals").ravel().tolist(),
        "light_plane_normals",
        3 * count,
    ).reshape(3, count)
    distances = _vector(found, "light_plane_distances_mm", count)
    with naming("light_plane_normals"):
        return tuple(
            LightPlane(normal, float(distance), name)
            for normal, distance, name in zip(normals.T, distances, names, strict=True)
        )


def _names(cells: Value) -> list[str]:
    if not isinstance(cells, list) or not all(cells) or len(set(cells)) < len(cells):
        raise InputError(
            "light_plane_names are no texts, empty or the same", "give each a name of its own"
        )
    return cells
