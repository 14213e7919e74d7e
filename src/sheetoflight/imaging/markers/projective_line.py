"""The picture of a straight scale: a projective map from mm along the target to the image line.

Along the image line of the target a point at t mm lies at ``s(t) = (a t + b) / (c t + 1)``. The
local scale is ``σ(t) = ds/dt = D / (c t + 1)²``, so that for any two points

    s(t2) − s(t1) = (t2 − t1) √(σ(t1) σ(t2)),

and the apparent sizes of two markers foretell their distance.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line


def foretold_points(ends: Array, scales: Array, fractions: Array) -> Array:
    """Image points ``(K, 2)`` between two ends, from the scales at the ends.

    Parameters
    ----------
    ends : (2, 2) array
        Image points of the scale's ends, px.
    scales : (2,) array
        Local scale at the ends, px per mm.
    fractions : (K,) array
        Where along the scale, 0 to 1.
    """
    denominators = 1.0 / np.sqrt(scales)
    between = denominators[0] + fractions * (denominators[1] - denominators[0])
    share = fractions * denominators[1] / between
    return ends[0] + share[:, None] * (ends[1] - ends[0])


def vanishing_point(uv: Array, positions: Array) -> Array:
    """Image ``(3,)``, homogeneous, of the point at infinity along the target.

    Least squares of ``s (c t + 1) = a t + b`` over the markers ``(M, 2)`` px at ``(M,)`` mm; for
    three markers the map is exact.
    """
    centre, direction = fitted_line(uv)
    s = (uv - centre) @ direction
    spread = np.abs(s).max()
    length = np.abs(positions).max()
    s, t = s / spread, positions / length
    design = np.stack([t, np.ones_like(t), -s * t], axis=-1)
    a, _, c = np.linalg.lstsq(design, s, rcond=None)[0]
    return np.append(a * spread * direction + c * centre, c)
