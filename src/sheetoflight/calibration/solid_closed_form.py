"""A camera from one view of a solid body with known points: the direct linear transform.

Y. Abdel-Aziz and H. Karara, "Direct linear transformation from comparator coordinates into object
space coordinates in close-range photogrammetry", Symposium on Close-Range Photogrammetry, 1971;
R. Hartley and A. Zisserman, *Multiple View Geometry*, 2nd ed., 2003, sections 7.1, 7.2 and 6.2.4.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array

_FEWEST = 6
"""A projection has eleven parameters, a point gives two equations."""

_ROUNDING = 1e-9
"""Spread of the points across a plane, and singular value of the equations, as parts of the
greatest ones, that are still rounding."""

_APART = 3.0
"""How much worse than the best projection the next one must fit: less, and noise chose."""


def dlt_camera(points: Array, uv: Array) -> tuple[Array, Array] | None:
    """Camera matrix and pose from one view of points in space.

    ``λ [u, v, 1]ᵀ = P [X, Y, Z, 1]ᵀ`` gives ``p1 · X − u p3 · X = 0`` and
    ``p2 · X − v p3 · X = 0`` for each point (*Multiple View Geometry*, eq. 7.2). P is the right
    singular vector of the smallest singular value, after the points have been centred and scaled;
    ``P = K [R t]`` follows from an RQ decomposition.

    Parameters
    ----------
    points : (M, 3) array
        Known points in the body's frame, mm.
    uv : (M, 2) array
        Their image points, px; NaN where not seen.

    Returns
    -------
    K : (3, 3) array, and camera_from_target : (3, 4) array ``[R t]``, or None
        K with skew, its last entry 1; t in mm. None where fewer than six points are seen, they
        lie in one plane, or another projection fits them almost as well: points and camera on a
        twisted cubic, or points on a plane and a line through the camera (section 22.1.1); and
        where the points' frame is left-handed, so that only a mirrored camera could see them so.
    """
    seen = np.isfinite(uv).all(axis=1)
    projection = _projection(points[seen], uv[seen])
    if projection is None:
        return None
    depth = points[seen] @ projection[2, :3] + projection[2, 3]
    if np.sum(depth) < 0:
        projection, depth = -projection, -depth
    if (depth <= 0).any() or np.linalg.det(projection[:, :3]) <= 0:
        return None
    K, R = _upper_and_rotation(projection[:, :3])
    t = np.linalg.solve(K, projection[:, 3])
    return np.triu(K / K[2, 2]), np.column_stack([R, t])


def _projection(points: Array, uv: Array) -> Array | None:
    """``P`` ``(3, 4)`` of unknown sign and scale."""
    if len(points) < _FEWEST or is_flat(points):
        return None
    to_space, to_image = _similarity(points), _similarity(uv)
    x = points @ to_space[:3, :3].T + to_space[:3, 3]
    p = uv @ to_image[:2, :2].T + to_image[:2, 2]
    x = np.column_stack([x, np.ones(len(x))])
    rows = np.zeros((len(x), 2, 12))
    rows[:, 0, :4] = rows[:, 1, 4:8] = x
    rows[:, :, 8:] = -p[..., None] * x[:, None]
    _, size, vectors = np.linalg.svd(rows.reshape(-1, 12), full_matrices=False)
    if size[10] < max(_ROUNDING * size[0], _APART * size[11]):
        return None
    return np.linalg.solve(to_image, vectors[11].reshape(3, 4) @ to_space)


def is_flat(points: Array) -> bool:
    """Whether points ``(M, 3)`` lie in one plane."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[-1] <= _ROUNDING * spread[0])


def _similarity(points: Array) -> Array:
    """Homogeneous similarity that moves points ``(M, d)`` to mean 0 and mean distance √d (*Multiple
    View Geometry*, section 7.1)."""
    size = points.shape[1]
    middle = points.mean(axis=0)
    spread = float(np.linalg.norm(points - middle, axis=1).mean())
    scale = np.sqrt(size) / spread if spread > 0 else 1.0
    whole = np.eye(size + 1)
    whole[:size, :size] *= scale
    whole[:size, size] = -scale * middle
    return whole


def _upper_and_rotation(matrix: Array) -> tuple[Array, Array]:
    """``M = K R`` with K upper triangular of positive diagonal, for ``det M > 0``: a QR
    decomposition of M with rows and columns reversed."""
    q, r = np.linalg.qr(matrix[::-1].T)
    upper, turn = r.T[::-1, ::-1], q.T[::-1]
    signs = np.where(np.diag(upper) < 0, -1.0, 1.0)
    return upper * signs, signs[:, None] * turn


def solid_pose(points: Array, xy: Array) -> Array | None:
    """Pose of a solid body before a known camera.

    As `dlt_camera`, with the rotation nearest to ``P``'s first three columns: with
    ``M = U S Vᵀ`` it is ``U Vᵀ``, and the mean of S is the scale.

    Parameters
    ----------
    points : (M, 3) array
        Known points in the body's frame, mm.
    xy : (M, 2) array
        Ideal normalised image points (K and distortion taken off); NaN where not seen.

    Returns
    -------
    (3, 4) array ``[R t]``, or None for the same reasons as in `dlt_camera`.
    """
    seen = np.isfinite(xy).all(axis=1)
    projection = _projection(points[seen], xy[seen])
    if projection is None:
        return None
    if np.linalg.det(projection[:, :3]) < 0:
        projection = -projection
    u, size, vt = np.linalg.svd(projection[:, :3])
    R = u @ vt
    middle = points[seen].mean(axis=0)
    # the scale's error shall move the body along its line of sight, and not its distant origin
    t = (projection[:, :3] @ middle + projection[:, 3]) / size.mean() - R @ middle
    in_front = points[seen] @ R[2] + t[2] > 0
    return np.column_stack([R, t]) if in_front.all() else None
