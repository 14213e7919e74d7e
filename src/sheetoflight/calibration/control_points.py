"""A sheet of light through control points: points of the sheet that a target tells.

The older methods differ in how they come by such points; the plane is the same for all of them,
the total least-squares one. A control point is bound to something of the target, its carrier: an
edge, a printed line, a flat face. Where all carriers lie in one plane, that plane fits the
control points perfectly whatever the light did, and noise makes them spread in it. So carriers
are looked at before the points are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import fitted_plane

_FEWEST = 3

_FLAT = 1e-2
"""Extent of the carriers across their plane, as a part of their greatest one, up to which they
count as lying in one plane."""

_ROUNDING = 1e-9
"""Extent of the points across their line, as a part of that along it, that is still rounding."""

_APART = 5.0
"""By how much the points' extent across their line exceeds that across their plane: with less,
noise alone could have made a plane of a line."""


@dataclass(frozen=True, eq=False)
class ControlledSheet:
    """A sheet of light and the points that it was found from.

    Parameters
    ----------
    normal : (3,) array
        Unit normal, camera frame.
    distance : float
        ``normal · X = distance >= 0``, mm.
    points : (P, 3) array
        The control points, mm, camera frame; NaN where none was to be had.
    """

    normal: Array
    distance: float
    points: Array

    def __post_init__(self) -> None:
        self.normal.setflags(write=False)
        self.points.setflags(write=False)

    @property
    def misses(self) -> Array:
        """``(P,)`` signed distances of the points from the sheet, mm."""
        return self.points @ self.normal - self.distance


def controlled_sheet(points: Array, carriers: Array) -> ControlledSheet:
    """The total least-squares plane through control points.

    Parameters
    ----------
    points : (P, 3) array
        Control points, mm, camera frame; rows of NaN are left out.
    carriers : (C, 3) array
        Points, mm, camera frame, that span the target's lines or faces to which the control
        points are bound.

    Raises
    ------
    UntrustworthyError
        If fewer than three points are there, all carriers lie in one plane, or the points lie
        on one line.
    """
    used = points[np.isfinite(points).all(axis=1)]
    if len(used) < _FEWEST:
        raise UntrustworthyError(
            "plane",
            f"{len(used)} points of the sheet were found, at least {_FEWEST} are needed",
            "show the line of light on more edges, faces or boards",
        )
    extent = _extents(carriers)
    if extent[2] <= _FLAT * extent[0]:
        raise UntrustworthyError(
            "plane",
            "all edges or faces that the light was seen on lie in one plane, "
            "so that its line there fits every sheet through it",
            "move the target between the views, or use one with faces at an angle",
        )
    along, across, off = _extents(used)
    if across <= max(_ROUNDING * along, _APART * off):
        raise UntrustworthyError(
            "plane",
            f"the points of the sheet lie on one line: they extend {across:.3g} mm across it, "
            f"and {off:.3g} mm off their best plane",
            "move the target nearer and farther between the views",
        )
    return ControlledSheet(*fitted_plane(used), points.copy())


def _extents(points: Array) -> Array:
    """Root mean square extents ``(3,)`` along the principal axes, the greatest first."""
    size = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return np.pad(size, (0, 3 - len(size))) / np.sqrt(len(points))


def placed(points: Array, poses: Array) -> Array:
    """Points ``(L, ..., 3)`` of targets' frames in the camera's, by poses ``(L, 3, 4)``."""
    flat = points.reshape(len(points), -1, 3)
    moved = flat @ np.swapaxes(poses[:, :, :3], 1, 2) + poses[:, None, :, 3]
    return moved.reshape(points.shape)


def image_lines(xy: Array, member: np.ndarray, count: int) -> Array:
    """Total least-squares lines of the image through points.

    Parameters
    ----------
    xy : (P, 2) array
        Ideal normalised image points.
    member : (P,) int array
        Number of the line that each belongs to.
    count : int
        Number L of lines.

    Returns
    -------
    (L, 3) array
        ``ℓ`` with ``ℓ · (x, y, 1) = 0`` and ``ℓ1² + ℓ2² = 1``; NaN where a line has fewer than two
        distinct points.
    """
    lines = np.full((count, 3), np.nan)
    for number in range(count):
        own = xy[member == number]
        if len(own) < 2 or not np.ptp(own, axis=0).any():
            continue
        middle = own.mean(axis=0)
        across = np.linalg.svd(own - middle, full_matrices=False)[2][1]
        lines[number] = [*across, -across @ middle]
    return lines
