"""Saddle points of the intensity: where two edges cross, as in a quadrant marker's centre."""

from __future__ import annotations

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.grey import Picture

_BLUR = 1.5
_MERGED_WITHIN = 5


def saddle_points(picture: Picture, least_contrast: float, most: int) -> tuple[Array, Array]:
    """Saddles of a picture smoothed by a Gaussian of 1.5 px, strongest first.

    Two crossing edges of contrast A, smoothed by s, have the Hessian determinant
    ``-(A sin φ / (π s²))²`` in their crossing, φ being the angle between them; its negative
    root times π s² is the strength.

    Parameters
    ----------
    picture : (H, W) float32
    least_contrast : float
        Smallest A sin φ that is of interest.
    most : int
        How many saddles to keep.

    Returns
    -------
    uv : (N, 2) px, to a fraction of a pixel
    strength : (N,)
        Estimates of A sin φ.
    """
    smooth = cv2.GaussianBlur(picture, (0, 0), _BLUR)
    uu = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3, scale=0.25)
    vv = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3, scale=0.25)
    uv = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3, scale=0.25)
    response = uv * uv - uu * vv
    # The [1 2 1]/4 of the masks smooths a little further: variance 1/2 each way.
    scale = np.pi * (_BLUR**2 + 0.5)
    least = np.float32((least_contrast / scale) ** 2)
    summit = cv2.dilate(response, np.ones((_MERGED_WITHIN, _MERGED_WITHIN), np.uint8))
    rows, columns = np.nonzero((response >= summit) & (response > least))
    inside = (rows > 0) & (columns > 0)
    inside &= (rows < picture.shape[0] - 1) & (columns < picture.shape[1] - 1)
    rows, columns = rows[inside], columns[inside]
    strength = np.sqrt(response[rows, columns].astype(float)) * scale
    order = np.argsort(-strength, kind="stable")[:most]
    rows, columns = rows[order], columns[order]
    hessian = np.stack([f[rows, columns].astype(float) for f in (uu, uv, vv)], axis=-1)
    gradient = np.stack(
        [
            smooth[rows, columns + 1].astype(float) - smooth[rows, columns - 1],
            smooth[rows + 1, columns].astype(float) - smooth[rows - 1, columns],
        ],
        axis=-1,
    )
    return np.stack([columns, rows], axis=-1) + _level_point(gradient / 2, hessian), strength[order]


def _level_point(gradient: Array, hessian: Array) -> Array:
    """Where the quadratic ``gradient``, ``hessian`` (uu, uv, vv) is level, at most 1 px away."""
    a, b, c = hessian[:, 0], hessian[:, 1], hessian[:, 2]
    determinant = a * c - b * b
    step_u = -(c * gradient[:, 0] - b * gradient[:, 1]) / determinant
    step_v = -(a * gradient[:, 1] - b * gradient[:, 0]) / determinant
    return np.clip(np.stack([step_u, step_v], axis=-1), -1.0, 1.0)
