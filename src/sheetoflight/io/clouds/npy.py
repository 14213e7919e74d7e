"""Point clouds as one structured array of NumPy."""

from __future__ import annotations

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
    # By a file, not by its name: to a name NumPy would add its own ending.
    with path.open("wb") as file:
        np.save(file, points, allow_pickle=False)
