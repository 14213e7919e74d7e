"""What a file of points says of each point: names, units and order, for all formats."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.model.point_cloud import PointCloud

COORDINATES = ("x", "y", "z")
"""The columns that hold the position, mm."""

Columns = dict[str, NDArray[Any]]
"""One value a point, ``(N,)`` each, by name."""


def columns(cloud: PointCloud) -> Columns:
    """Every column of a cloud, in the order of a table.

    ``picture`` (number among the cloud's pictures, from 0), ``line``; ``u``, ``v`` in px; ``x``,
    ``y``, ``z``, the standard uncertainty of the position ``std_mm``, its part from the picture's
    noise ``noise_mm`` and the standard uncertainties of the coordinates ``std_x_mm``,
    ``std_y_mm``, ``std_z_mm``, all in mm; ``peak`` in grey levels. Whole numbers have 32 bits,
    the others 64.
    """
    parts = {
        "picture": cloud.picture,
        "line": cloud.line,
        **_split(cloud.uv, ("u", "v")),
        **_split(cloud.xyz, COORDINATES),
        "std_mm": cloud.std,
        "noise_mm": cloud.noise_std,
        **_split(cloud.std_xyz, ("std_x_mm", "std_y_mm", "std_z_mm")),
        "peak": cloud.peak,
    }
    whole = ("picture", "line")
    return {
        name: np.ascontiguousarray(values, np.int32 if name in whole else np.float64)
        for name, values in parts.items()
    }


def attributes(cloud: PointCloud) -> Columns:
    """All columns but the coordinates, each of 32 bits: seven digits are ample for what only
    describes a point.
    """
    return {
        name: values if values.dtype == np.int32 else values.astype(np.float32)
        for name, values in columns(cloud).items()
        if name not in COORDINATES
    }


def _split(values: NDArray[Any], names: tuple[str, ...]) -> Columns:
    return dict(zip(names, np.transpose(values), strict=True))
