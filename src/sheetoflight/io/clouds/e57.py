"""Point clouds as E57 (ASTM E2807), by pye57 and the libE57Format within it."""

from __future__ import annotations

import hashlib
import importlib
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.io.clouds.columns import COORDINATES, Columns, attributes
from sheetoflight.model.point_cloud import PointCloud

EXTENSION = ("sol", "urn:sheetoflight:e57:points:1")
"""Prefix and name of the extension that holds what E57 itself has no place for."""

_M_PER_MM = 1e-3
_DESCRIPTION = (
    "Points of a laser line in the camera frame: x right, y down, z forward, m. Fields sol:std_m, "
    "sol:noise_m, sol:std_x_m, sol:std_y_m, sol:std_z_m are standard uncertainties, m; "
    "sol:u, sol:v the image point, px; sol:line and sol:picture numbers, from 0."
)


def write_e57(path: Path, cloud: PointCloud) -> None:
    """Write one scan with Cartesian coordinates, in metres as the standard asks.

    E57 has no field for an uncertainty. By its rule for extensions, further fields go under a name
    space of their own: ``sol:std_m``, ``sol:noise_m``, ``sol:std_x_m``, ``sol:std_y_m``,
    ``sol:std_z_m``, all in metres like the coordinates, ``sol:u``, ``sol:v``, ``sol:line`` and
    ``sol:picture``. Readers that do not know them pass over them. The intensity is the peak.

    The identifiers are drawn from the content and no date is given, so the same cloud gives the
    same bytes. An empty cloud becomes a file without a scan: a scan without points is more than
    libE57Format can read back.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    libe57: Any = importlib.import_module("pye57.libe57")  # compiled, and without types
    try:
        _Document(libe57, path, _fields(cloud)).write()
    except libe57.E57Exception as error:
        raise OSError(str(error).partition("\n")[0]) from error


def _fields(cloud: PointCloud) -> Columns:
    """The columns under the names, and in the units, of E57."""
    fields: Columns = {
        f"cartesian{name.upper()}": np.multiply(cloud.xyz[:, axis], _M_PER_MM)
        for axis, name in enumerate(COORDINATES)
    }
    further = attributes(cloud)
    fields["intensity"] = np.nan_to_num(further.pop("peak"))
    for name, values in further.items():
        if values.dtype == np.int32:
            # pye57 takes numpy's int64 for 32 bits, and no int32: long long is what it says.
            fields[f"{EXTENSION[0]}:{name}"] = values.astype(np.longlong)
        elif name.endswith("_mm"):
            metres = values * np.float32(_M_PER_MM)
            fields[f"{EXTENSION[0]}:{name.removesuffix('_mm')}_m"] = metres
        else:
            fields[f"{EXTENSION[0]}:{name}"] = values
    return fields


class _Document:
    """One E57 file on its way to the disk."""

    def __init__(self, libe57: Any, path: Path, fields: Columns) -> None:
        self.libe57, self.fields = libe57, fields
        self.file = libe57.ImageFile(str(path), "w")

    def write(self) -> None:
        """Write everything; after a failure the file is closed all the same."""
        try:
            self._root()
            self.file.close()
        except BaseException:
            self.file.cancel()
            raise

    def _root(self) -> None:
        self.file.extensionsAdd("", self.libe57.E57_V1_0_URI)
        self.file.extensionsAdd(*EXTENSION)
        scans = self.libe57.VectorNode(self.file, True)
        self._put(
            self.file.root(),
            formatName="ASTM E57 3D Imaging Data File",
            guid=self._guid("file"),
            versionMajor=self.libe57.E57_FORMAT_MAJOR,
            versionMinor=self.libe57.E57_FORMAT_MINOR,
            coordinateMetadata="",
            data3D=scans,
            images2D=self.libe57.VectorNode(self.file, True),
        )
        if self._count():
            self._scan(scans)

    def _scan(self, scans: Any) -> None:
        points = self.libe57.CompressedVectorNode(
            self.file, self._prototype(), self.libe57.VectorNode(self.file, True)
        )
        scan = self._structure(
            guid=self._guid("scan"),
            name="laser line",
            description=_DESCRIPTION,
            cartesianBounds=self._bounds(x="cartesianX", y="cartesianY", z="cartesianZ"),
            intensityLimits=self._bounds(intensity="intensity"),
            points=points,
        )
        scans.append(scan)
        writer = points.writer(self._buffers())
        try:
            writer.write(self._count())
        finally:
            # libE57Format crashes where a file is given up while it is written to.
            writer.close()

    def _prototype(self) -> Any:
        """What each point holds, and in which kind of number."""
        prototype = self.libe57.StructureNode(self.file)
        for name, values in self.fields.items():
            prototype.set(name, self._kind(values))
        return prototype

    def _kind(self, values: Any) -> Any:
        if values.dtype.kind == "i":
            low, high = int(values.min()), int(values.max())
            return self.libe57.IntegerNode(self.file, low, low, high)
        single = values.dtype == np.float32
        precision = self.libe57.E57_SINGLE if single else self.libe57.E57_DOUBLE
        return self.libe57.FloatNode(self.file, 0.0, precision)

    def _buffers(self) -> Any:
        buffers = self.libe57.VectorSourceDestBuffer()
        for name, values in self.fields.items():
            buffers.append(
                self.libe57.SourceDestBuffer(self.file, name, values, len(values), True, True)
            )
        return buffers

    def _bounds(self, **fields: str) -> Any:
        """The least and the largest value of fields, under names for both."""
        bounds = {}
        for name, field in fields.items():
            bounds[f"{name}Minimum"] = float(self.fields[field].min())
            bounds[f"{name}Maximum"] = float(self.fields[field].max())
        return self._structure(**bounds)

    def _structure(self, **children: Any) -> Any:
        return self._put(self.libe57.StructureNode(self.file), **children)

    def _put(self, node: Any, **children: Any) -> Any:
        """Hang children on a node: text, numbers or nodes."""
        kinds = {str: "StringNode", int: "IntegerNode", float: "FloatNode"}
        for name, child in children.items():
            kind = kinds.get(type(child))
            node.set(name, getattr(self.libe57, kind)(self.file, child) if kind else child)
        return node

    def _count(self) -> int:
        return len(self.fields["cartesianX"])

    def _guid(self, what: str) -> str:
        """An identifier of the content: E57 asks for one, chance would change the bytes."""
        digest = hashlib.sha256(what.encode())
        for values in self.fields.values():
            digest.update(values.tobytes())
        return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, digest.hexdigest())}}}"
