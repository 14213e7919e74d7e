"""Point clouds as one structured array of NumPy."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from sheetoflight.io.clouds.columns import columns
from sheetoflight.model.point_cloud import PointCloud


def write_npy(path: Path, cloud: PointCloud) -> None:
    """Write an ``(N,)`` array whose fields are the columns, read by ``numpy.load``.

    Lengths are in mm. ``picture`` is the number of the picture, from 0.
    """
    table = columns(cloud)
    kinds = [(name, values.dtype.newbyteorder("<")) for name, values in table.items()]
    points = np.empty(len(cloud), dtype=kinds)
    for name, values in table.items():
        points[name] = values
    # To a file NumPy writes past Python, and says nothing where the disk fills up at the end.
    buffer = io.BytesIO()
    np.save(buffer, points, allow_pickle=False)
    # The value, not a view: a view held by an exception crashes Python 3.12.
    path.write_bytes(buffer.getvalue())
