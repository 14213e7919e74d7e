"""Scanners whose object moves through the sheet of light: one cloud in the object's own frame."""

from __future__ import annotations

from dataclasses import replace

from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.straightness import SpaceLine
from sheetoflight.model.point_cloud import PointCloud


def moved_back(cloud: PointCloud, step_mm: Array, steps: int) -> PointCloud:
    """Points of an object as they lay before it moved.

    A point that lay at ``X`` in the first frame is seen at ``X + k·step`` in frame k (from 0), so
    that ``k·step`` is taken away.

    Parameters
    ----------
    cloud : PointCloud
    step_mm : (3,) array
        By what the object moves from one frame to the next, in the frame of the points, mm.
    steps : int
        How often it has moved: k. Frames that gave no points count.

    Returns
    -------
    PointCloud
        Its uncertainties as they were: what is uncertain in the step is not in them.
    """
    return replace(cloud, xyz=cloud.xyz - steps * step_mm)


def line_moved_back(line: SpaceLine, step_mm: Array, steps: int) -> SpaceLine:
    """A line on an object as it lay before the object moved; see `moved_back`."""
    return replace(line, point=line.point - steps * step_mm)
