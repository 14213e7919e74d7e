"""Rotations about an axis."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array


def rotation(vector: Array) -> Array:
    """Rotation matrices ``(..., 3, 3)`` about vectors ``(..., 3)``, by their lengths in radians
    (Rodrigues).

    Examples
    --------
    >>> rotation(np.array([0.0, 0.0, np.pi / 2])).round(12) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    # sin(t)/t and (1 − cos t)/t², without loss of digits near t = 0
    sine = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + sine * cross + versine * (cross @ cross)


def cross_matrix(vectors: Array) -> Array:
    """``[v]ₓ (..., 3, 3)`` of vectors ``(..., 3)``: ``[v]ₓ w = v × w``."""
    matrix = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    matrix[..., 0, 1], matrix[..., 1, 0] = -z, z
    matrix[..., 0, 2], matrix[..., 2, 0] = y, -y
    matrix[..., 1, 2], matrix[..., 2, 1] = -x, x
    return matrix
