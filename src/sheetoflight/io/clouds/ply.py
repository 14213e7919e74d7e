"""Point clouds as PLY, by meshio."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from sheetoflight.errors import FileError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.clouds.columns import attributes
from sheetoflight.io.quoting import file_name, one_line
from sheetoflight.io.reading import read_bytes
from sheetoflight.model.point_cloud import PointCloud

_HEADER = re.compile(rb"ply\s.*?^element vertex (\d+)\s.*?^end_header\s", re.DOTALL | re.MULTILINE)
_LIMIT_BYTES = 16 * 1024**3
_COMMENT = b"comment lengths in mm, camera frame, u and v in px, peak in grey levels\n"


def write_ply(path: Path, cloud: PointCloud) -> None:
    """Write a binary PLY file of vertices without faces.

    ``x``, ``y``, ``z`` in mm are ``double``; ``picture`` (the number of the picture, from 0) and
    ``line`` are ``int32``; the other columns ``float``.
    """
    from meshio import Mesh, ply

    mesh = Mesh(np.array(cloud.xyz, dtype=np.float64), [], point_data=dict(attributes(cloud)))
    buffer = io.BytesIO()
    ply.write(buffer, mesh)
    # meshio's only comment holds the time: the same cloud is to give the same bytes.
    content = buffer.getvalue()  # no view: one held by an exception crashes Python 3.12
    start = content.index(b"comment ")
    stop = content.index(b"\n", start) + 1
    with path.open("wb") as file:
        file.writelines((content[:start], _COMMENT, memoryview(content)[stop:]))


def read_ply(path: str | Path) -> Array:
    """Positions of the vertices ``(N, 3)`` of an ASCII or binary PLY file, in the file's unit.

    Raises
    ------
    FileError
        If the file is missing or damaged, or its vertices do not begin with ``x``, ``y``, ``z``.
    """
    data = read_bytes(path, _LIMIT_BYTES)
    try:
        return _vertices(data)
    except Exception as error:  # meshio raises whatever a damaged file makes it stumble over
        raise FileError(
            f"{file_name(path)} cannot be read as PLY ({one_line(str(error)) or 'damaged'})",
            "check that it was written to the end, and that its vertices begin with x, y, z",
        ) from error


def _vertices(data: bytes) -> Array:
    from meshio import ply

    # meshio would look for ever for the end of a header that has none, and takes what there is of
    # a file that ends between two vertices.
    header = _HEADER.match(data)
    if header is None:
        raise ValueError("its header has no vertices or no end")
    points = np.asarray(ply.read(io.BytesIO(data)).points, dtype=np.float64)
    if len(points) != int(header[1]):
        raise ValueError(f"its header promises {int(header[1])} vertices, {len(points)} are there")
    return points
