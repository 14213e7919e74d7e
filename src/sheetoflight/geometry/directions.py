"""Unit vectors, and steps on the unit sphere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
"""Real numbers; double precision unless a picture brought them."""


def normalised(vectors: Array) -> Array:
    """Scale vectors ``(..., n)`` to length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def tangent_basis(directions: Array) -> tuple[Array, Array]:
    """Two unit vectors that complete each unit vector ``(..., 3)`` to a right-handed frame.

    The construction has no branch and no singular direction: Duff et al., "Building an
    orthonormal basis, revisited", J. Computer Graphics Techniques 6(1), 2017, eq. 5.

    Examples
    --------
    >>> e1, e2 = tangent_basis(np.array([0.0, 0.0, 1.0]))
    >>> np.cross(e1, e2)
    array([0., 0., 1.])
    """
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return first, second


def moved(directions: Array, steps: Array) -> Array:
    """Move unit vectors ``(..., 3)`` by tangent steps ``(..., 2)`` in `tangent_basis`."""
    first, second = tangent_basis(directions)
    return normalised(directions + steps[..., :1] * first + steps[..., 1:] * second)
