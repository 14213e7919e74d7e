"""The table of formats by the file's ending, and the two verbs: write a cloud, read a cloud."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.atomic import written_whole
from sheetoflight.io.clouds.e57 import write_e57
from sheetoflight.io.clouds.las import write_las, write_laz
from sheetoflight.io.clouds.npy import write_npy
from sheetoflight.io.clouds.ply import read_ply, write_ply
from sheetoflight.io.clouds.text import write_csv, write_xyz
from sheetoflight.io.quoting import file_name
from sheetoflight.model.point_cloud import PointCloud

_WRITERS: dict[str, Callable[[Path, PointCloud], None]] = {
    ".ply": write_ply,
    ".las": write_las,
    ".laz": write_laz,
    ".e57": write_e57,
    ".csv": write_csv,
    ".xyz": write_xyz,
    ".npy": write_npy,
}

CLOUD_ENDINGS = tuple(_WRITERS)
"""The endings that name a format of point clouds."""


def check_cloud_name(path: str | Path) -> None:
    """Refuse a file whose ending names no format, before any work is done for it.

    Raises
    ------
    InputError
        If the ending is none of `CLOUD_ENDINGS`, in capitals or not.

    Examples
    --------
    >>> check_cloud_name("scan.PLY")
    >>> check_cloud_name("scan.pcd")
    Traceback (most recent call last):
    ...
    sheetoflight.errors.InputError: scan.pcd: no point clouds are written as '.pcd' – end the name
    in .ply, .las, .laz, .e57, .csv, .xyz or .npy
    """
    _check_ending(path, CLOUD_ENDINGS, "written")


def write_cloud(path: str | Path, cloud: PointCloud) -> None:
    """Write a point cloud, whole or not at all, in the format that the file's ending names.

    Every format holds the position of each point in the camera frame and its standard
    uncertainty; all but ``.xyz`` also the uncertainty of each coordinate, the part that comes from
    the picture's noise, the image point, the peak, the line and the picture. The same cloud gives
    the same bytes.

    ========  =======  ==========================================================================
    ending    unit     what each coordinate keeps
    ========  =======  ==========================================================================
    ``.ply``  mm       all of it (64 bits)
    ``.las``  mm       a multiple of 0.0001 mm
    ``.laz``  mm       as ``.las``, compressed
    ``.e57``  m        all of it (64 bits)
    ``.csv``  mm       all of it, as text
    ``.xyz``  mm       all of it, as text
    ``.npy``  mm       all of it (64 bits)
    ========  =======  ==========================================================================

    Parameters
    ----------
    path : str or Path
        Ends in one of `CLOUD_ENDINGS`, in capitals or not.
    cloud : PointCloud
        May be empty.

    Raises
    ------
    InputError
        If the ending names no format, or the points are too far apart for it (LAS).
    FileError
        If the file cannot be written; nothing is left behind.
    """
    check_cloud_name(path)
    with written_whole(path) as beside:
        _WRITERS[_ending(path)](beside, cloud)


def read_cloud(path: str | Path) -> Array:
    """Positions of the points of a PLY file ``(N, 3)``, in the file's unit and frame.

    Raises
    ------
    InputError
        If the file's ending is another.
    FileError
        If the file cannot be read as PLY.
    """
    _check_ending(path, (".ply",), "read")
    return read_ply(path)


def _check_ending(path: str | Path, endings: tuple[str, ...], done: str) -> None:
    ending = _ending(path)
    if ending not in endings:
        named = f"no point clouds are {done} as '{file_name(ending)}'"
        *others, last = endings
        choice = f"{', '.join(others)} or {last}" if others else last
        raise InputError(
            f"{file_name(path)}: {named if ending else 'the name has no ending'}",
            f"end the name in {choice}" if done == "written" else f"give a {choice} file",
        )


def _ending(path: str | Path) -> str:
    return Path(path).suffix.lower()
