"""HALCON's poses: a light plane is the plane z = 0 of one.

A pose is seven numbers: the translation in metres, three angles in degrees, and a code for their
order. Of the codes those are read that say "rotate, then translate" about the point
(``'Rp+T'``, ``'point'``), by the operator reference's ``create_pose``:

====  =============  ==================================================
code  order          rotation
====  =============  ==================================================
0     ``gba``        ``Rx(RotX) Ry(RotY) Rz(RotZ)``
2     ``abg``        ``Rz(RotZ) Ry(RotY) Rx(RotX)``
4     ``rodriguez``  about the vector, whose length is the tangent of half the angle
====  =============  ==================================================
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.rotations import rotation
from sheetoflight.io.exchange.values import counted_numbers
from sheetoflight.io.quoting import one_line
from sheetoflight.io.reading import naming, read_text
from sheetoflight.model.light_plane import LightPlane

_MM_PER_M = 1000.0
_LIMIT_BYTES = 65536
_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,4})?"
_PARTS = {"t": 3, "r": 3, "f": 1}
"""Lines of a pose file: translation, rotation, and code, with how many numbers each."""


def read_pose(path: str | Path, name: str = "laser") -> LightPlane:
    """The light plane of a pose file, as ``write_pose`` writes it, or of seven numbers.

    Raises
    ------
    FileError
        If the file cannot be read.
    InputError
        If it holds no pose, one of another code, or one whose plane holds the camera's centre.
    """
    text = read_text(path, _LIMIT_BYTES)
    with naming(path):
        return light_plane_of(pose_numbers(text), name)


def pose_numbers(text: str) -> Array:
    """The seven numbers of a pose ``(7,)``.

    Raises
    ------
    InputError
        If the text holds no pose.
    """
    lines = [line for line in text.splitlines() if line.strip() and line.strip()[0] != "#"]
    words = re.sub(r"[\[\],;]", " ", " ".join(lines)).split()
    if words and words[0] in _PARTS:
        words = _in_order(words)
    if len(words) != 7 or not all(re.fullmatch(_NUMBER, word) for word in words):
        raise InputError(
            f"there is no pose in '{one_line(' '.join(words))}'",
            "give a file that write_pose wrote, or the seven numbers of a pose",
        )
    return counted_numbers([float(word) for word in words], "the pose", 7)


def _in_order(words: list[str]) -> list[str]:
    """The numbers of the lines t, r and f; none where one of these is missing."""
    found: dict[str, list[str]] = {}
    while words and words[0] in _PARTS and words[0] not in found:
        count = _PARTS[words[0]]
        found[words[0]], words = words[1 : 1 + count], words[1 + count :]
    return [word for part in _PARTS for word in found.get(part, [])] if not words else []


def light_plane_of(pose: Array, name: str) -> LightPlane:
    """The plane z = 0 of a pose ``(7,)``, in mm.

    Raises
    ------
    InputError
        If the code is another than 0, 2 or 4, or the plane holds the camera's centre.
    """
    normal = _rotation(pose[3:6], float(pose[6]))[:, 2]
    distance = _MM_PER_M * float(normal @ pose[:3])
    return LightPlane(normal, distance, name) if distance >= 0 else LightPlane(
        -normal, -distance, name
    )  # fmt: skip


def _rotation(turned: Array, code: float) -> Array:
    if code == 4:
        length = float(np.linalg.norm(turned))
        angle = 2.0 * np.arctan(length)
        return rotation(turned * (angle / length)) if length > 0 else np.eye(3)
    about_x, about_y, about_z = (
        rotation(np.radians(angle) * axis) for angle, axis in zip(turned, np.eye(3), strict=True)
    )
    if code == 0:
        return about_x @ about_y @ about_z
    if code == 2:
        return about_z @ about_y @ about_x
    raise InputError(
        f"the pose has the code {code:g}, expected 0, 2 or 4",
        "turn it with convert_pose_type into 'Rp+T', 'gba', 'point'",
    )


def pose_of(plane: LightPlane) -> Array:
    """A pose ``(7,)`` of code 0 whose plane z = 0 is the light plane.

    Its origin is the point of the plane that is nearest to the camera.
    """
    nx, ny, nz = plane.normal.tolist()
    about_x = np.degrees(np.arctan2(-ny, nz))
    about_y = np.degrees(np.arctan2(nx, np.hypot(ny, nz)))
    origin = plane.normal * (plane.distance_mm / _MM_PER_M)
    return np.array([*origin, about_x, about_y, 0.0, 0.0])
