"""Point clouds as LAS 1.4 and, compressed, as LAZ, by laspy."""

from __future__ import annotations

import importlib
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.clouds.columns import attributes
from sheetoflight.model.point_cloud import PointCloud

SCALE_MM = 1e-4
"""Step of the coordinates in a LAS file: far below what a sheet of light resolves."""

_POINT_FORMAT = 6  # the plainest of LAS 1.4
_LARGEST = 2**31 - 1
_DATE = date(1970, 1, 1)  # laspy would put today's: the same cloud is to give the same bytes
_UNITS = {"u": "px", "v": "px", "peak": "grey levels", "line": "number", "picture": "number"}


def write_las(path: Path, cloud: PointCloud) -> None:
    """Write LAS 1.4, point format 6, with every further column as an extra dimension.

    Coordinates are in mm – LAS itself has no unit – in steps of `SCALE_MM`, which 32 bits carry to
    214 m on either side of the middle. The intensity is the peak, rounded; ``peak`` holds it
    unrounded. The date of creation is fixed at 1 January 1970.

    Raises
    ------
    InputError
        If the points lie too far apart for the step: a coarser one would lose precision unsaid.
    OSError
        If the file cannot be written.
    """
    _write(path, cloud, compressed=False)


def write_laz(path: Path, cloud: PointCloud) -> None:
    """Write the same as `write_las`, compressed without loss by lazrs."""
    _write(path, cloud, compressed=True)


def _write(path: Path, cloud: PointCloud, compressed: bool) -> None:
    import laspy

    lazrs: Any = importlib.import_module("lazrs")  # its types leave out its error
    points = _points(cloud)
    try:
        with path.open("wb") as file:
            points.write(file, do_compress=compressed, laz_backend=laspy.LazBackend.Lazrs)
    except lazrs.LazrsError as error:
        raise OSError(str(error)) from error


def _points(cloud: PointCloud) -> Any:
    """The points as laspy holds them."""
    import laspy

    further = attributes(cloud)
    offset = _offset(cloud.xyz)
    points = laspy.LasData(_header(further, offset))
    steps = _steps(cloud.xyz, offset)
    points.X, points.Y, points.Z = steps.T
    points.intensity = np.clip(np.rint(np.nan_to_num(cloud.peak)), 0, 65535).astype(np.uint16)
    points.return_number = points.number_of_returns = np.ones(len(cloud), dtype=np.uint8)
    for name, values in further.items():
        points[name] = values
    return points


def _header(further: dict[str, Any], offset: Array) -> Any:
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=_POINT_FORMAT)
    header.creation_date = _DATE
    header.generating_software = "sheetoflight"
    header.global_encoding.wkt = True  # LAS 1.4 asks for it from point format 6 on
    header.offsets, header.scales = offset, np.full(3, SCALE_MM)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(name, values.dtype, _UNITS.get(name, "mm"))
            for name, values in further.items()
        ]
    )
    return header


def _offset(xyz: Array) -> Array:
    """The middle of the points, in whole mm."""
    if not len(xyz):
        return np.zeros(3)
    return np.rint(xyz.min(axis=0) / 2 + xyz.max(axis=0) / 2)


def _steps(xyz: Array, offset: Array) -> Any:
    """Coordinates in steps from the offset ``(N, 3)``, 32 bits."""
    steps = np.rint((xyz - offset) / SCALE_MM)
    if np.abs(steps).max(initial=0) > _LARGEST:
        extent = float(np.ptp(xyz, axis=0).max())
        raise InputError(
            f"the points lie up to {extent / 1000:.4g} m apart; LAS holds "
            f"{2 * _LARGEST * SCALE_MM / 1000:.4g} m in steps of {SCALE_MM:.4f} mm",
            "leave out the points that lie far off, or write .ply, .e57, .csv, .xyz or .npy",
        )
    return steps.astype(np.int32)
