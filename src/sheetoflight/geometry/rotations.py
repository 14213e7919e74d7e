"""Rotations about an axis."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array


def rotation(vector: Array) -> Array:
    """Rotation matrix ``(3, 3)`` about a vector ``(3,)``, by its length in radians (Rodrigues).

    Examples
    --------
    >>> rotation(np.array([0.0, 0.0, np.pi / 2])).round(12) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(t)/t and (1 − cos t)/t², without loss of digits near t = 0
    sine = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + sine * cross + versine * (cross @ cross)
