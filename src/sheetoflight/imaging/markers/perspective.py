"""The image of a disc's centre, which is not the middle of the ellipse that the disc becomes."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.projective_line import vanishing_point

_ROUNDS = 3


def disc_centres(uv: Array, frames: Array, positions: Array) -> Array:
    """Image points of disc centres, freed of the perspective bias along the target.

    The vanishing point V of the target's direction lies on the vanishing line of the discs'
    plane, the polar of every disc's true centre; hence the true centre lies on the polar of V
    with respect to the ellipse. On the chord from the ellipse's middle towards V, r being half
    the chord and s the distance to V, that is a step of r²/s towards V (V and the point divide
    the chord harmonically). V follows from the markers' spacing, and the two are iterated.
    The bias across the target is not touched: the spacing says nothing of it.

    Parameters
    ----------
    uv : (M, 2) array
        Middles of the ellipses, px.
    frames : (M, 2, 2) array
        Map the unit circle to each ellipse about its middle.
    positions : (M,) array
        Markers along the target, mm.
    """
    centres = uv
    for _ in range(_ROUNDS):
        vanishing = vanishing_point(centres, positions)
        towards = vanishing[:2] - vanishing[2] * uv
        reach = np.linalg.norm(towards, axis=1)
        unit = towards / reach[:, None]
        half_chord = 1.0 / np.linalg.norm(np.linalg.solve(frames, unit[..., None])[..., 0], axis=1)
        centres = uv + (half_chord**2 * vanishing[2] / reach)[:, None] * unit
    return centres


def bias_left(frames: Array, focal_px: float) -> Array:
    """Standard uncertainty ``(M,)`` px of the bias that `disc_centres` cannot see.

    A disc of semi-axes a > b is tilted by cos θ = b/a, and its ellipse's middle is off by
    a² sin θ cos θ / f in some direction. Half of that as a variance is across the target.

    Parameters
    ----------
    frames : (M, 2, 2) array
    focal_px : float
        Focal length in px, a rough one will do.
    """
    semi = np.linalg.svd(frames, compute_uv=False)
    cosine = semi[..., 1] / semi[..., 0]
    return semi[..., 0] ** 2 * cosine * np.sqrt(1.0 - cosine**2) / (np.sqrt(2.0) * focal_px)
