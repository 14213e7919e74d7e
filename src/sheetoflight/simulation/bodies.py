"""Solid targets to simulate with."""

from __future__ import annotations

import math

import numpy as np

from sheetoflight.model.board import SolidTarget


def folded_body(
    opening_deg: float = 130.0, points: tuple[int, int] = (5, 5), pitch_mm: float = 25.0
) -> SolidTarget:
    """Two boards that meet at an edge and open towards the viewer, like a book.

    The edge is the second axis; the first board lies on the side of the positive first axis, the
    second mirrors it, and both come forward, against the third axis.

    Parameters
    ----------
    opening_deg : float
        Angle between the boards.
    points : (int, int)
        Points across and along the edge, on each board; the first column lies on the edge, so
        that the edge's points are given twice.
    pitch_mm : float
        Distance between neighbouring points.
    """
    across, along = (pitch_mm * np.arange(n) for n in points)
    out, down = (a.ravel() for a in np.meshgrid(across, along))
    half = math.radians(opening_deg) / 2.0
    first = np.column_stack([math.sin(half) * out, down, -math.cos(half) * out])
    count = len(first)
    return SolidTarget(
        np.concatenate([first, first * (-1.0, 1.0, 1.0)]),
        (range(count), range(count, 2 * count)),
    )
