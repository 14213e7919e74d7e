"""The metric homography between a sheet of light and the image, from targets lying in it.

No camera is needed. Along a target the image point of position s is ``(a + s b)/(1 + s r)``, so
three markers give its vanishing point ``[b; r]``. All vanishing points lie on the sheet's
vanishing line ℓ; sending ℓ to infinity leaves an affine picture of the sheet, in which the
squared length of a target is a quadratic form ``δᵀ S δ`` of the difference of its ends, linear in
S: R. Hartley and A. Zisserman, *Multiple View Geometry*, 2nd ed., 2003, section 2.7, with known
lengths in place of known angles.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array

_REWEIGHTINGS = 3


def line_maps(points: Array, positions: Array) -> Array:
    """For every view the projective map along the target, ``(N, 3, 2)``.

    Columns are the homogeneous image of position 0, ``[a; 1]``, and of the direction, ``[b; r]``
    per unit of `positions`; NaN where fewer than three markers were seen.

    Parameters
    ----------
    points : (N, M, 2) array
        Image points, NaN where not seen.
    positions : (M,) array
    """
    seen = np.asarray(np.isfinite(points).all(axis=-1))
    image = np.where(seen[..., None], points, 0.0)
    ratio = np.ones(points.shape[:2])
    solution = np.zeros((len(points), 5))
    for _ in range(_REWEIGHTINGS):
        weight = np.where(seen, 1.0 / ratio, 0.0)
        rows = np.zeros((*points.shape[:2], 2, 5))
        rows[..., 0, 0] = rows[..., 1, 1] = weight
        rows[..., 0, 2] = rows[..., 1, 3] = weight * positions
        rows[..., 4] = -(weight * positions)[..., None] * image
        system = rows.reshape(len(points), -1, 5)
        right = (weight[..., None] * image).reshape(len(points), -1, 1)
        solution = (np.linalg.pinv(system) @ right)[..., 0]
        ratio = np.maximum(1.0 + positions * solution[:, 4:], 0.05)
    maps = np.stack([solution[:, [0, 1]], solution[:, [2, 3]]], axis=-1)
    last = np.stack([np.ones(len(points)), solution[:, 4]], axis=-1)[:, None, :]
    maps = np.concatenate([maps, last], axis=1)
    maps[seen.sum(axis=1) < 3] = np.nan
    return maps


def sheet_map(points: Array, positions: Array) -> Array | None:
    """Homography ``(3, 3)`` from image points to the sheet, both in the given units.

    The sheet's frame is chosen: its origin is seen at the image's origin, and its first axis
    along the image's first one there.

    Parameters
    ----------
    points : (N, M, 2) array
        Image points of at least three targets that are not parallel; centred and scaled to
        about one for numbers' sake.
    positions : (M,) array

    Returns
    -------
    (3, 3) array, or None where the views do not give one.
    """
    maps = line_maps(points, positions)
    maps = maps[np.isfinite(maps).all(axis=(1, 2))]
    if len(maps) < 3:
        return None
    vanishing = maps[..., 1]
    # an estimate of r is worth the more the longer the image of the target is
    weighted = vanishing / np.linalg.norm(vanishing[:, :2], axis=1, keepdims=True) ** 0.5
    line = np.linalg.svd(weighted, full_matrices=False)[2][-1]
    if abs(line[2]) < 1e-9:
        return None
    rectify = np.array([[1.0, 0, 0], [0, 1.0, 0], line / line[2]])
    # ends: position 0, and the last
    length = positions[-1] - positions[0]
    first = (maps[..., 0] + positions[0] * maps[..., 1]) @ rectify.T
    last = (maps[..., 0] + positions[-1] * maps[..., 1]) @ rectify.T
    if (first[:, 2] * last[:, 2] <= 0).any():
        return None
    difference = last[:, :2] / last[:, 2:] - first[:, :2] / first[:, 2:]
    x, y = difference.T
    rows = np.stack([x * x, 2.0 * x * y, y * y], axis=1)
    form, _, rank, _ = np.linalg.lstsq(rows, np.full(len(rows), length**2), rcond=1e-10)
    metric = np.array([[form[0], form[1]], [form[1], form[2]]])
    if rank < 3:
        return None
    try:
        upper = np.linalg.cholesky(metric).T
    except np.linalg.LinAlgError:
        return None
    whole = np.eye(3)
    whole[:2, :2] = upper
    return whole @ rectify
