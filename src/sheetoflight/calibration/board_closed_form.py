"""Homographies of flat boards, and the poses that follow from them.

A board's plane z = 0 is seen through ``H ~ K [r1 r2 t]``: Z. Zhang, "A flexible new technique for
camera calibration", IEEE Trans. PAMI 22(11), 2000, eq. 2; P. Sturm and S. Maybank, "On plane-based
camera calibration", CVPR 1999. K from such homographies is the matter of `camera_closed_form`.

Here all views are worked on at once: sums over points and small matrices, no loop over views.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array, normalised, tangent_basis

_FEWEST = 4
"""A homography has eight parameters, a point gives two equations."""

_FLAT = 1e-9
"""Spread of points across their line, as a part of that along it, both squared, that is still
rounding; and what a leverage lacks to 1."""


def homographies(points: Array, uv: Array) -> Array:
    """Homographies ``(N, 3, 3)`` from a board's plane to the image in each view.

    With board points ``m = [x, y, 1]`` the equations ``h1 · m = u h3 · m``, ``h2 · m = v h3 · m``
    are linear; eliminating h1 and h2 leaves a 3 x 3 eigenvalue problem for h3 (Harker and
    O'Leary, "Computation of homographies", BMVC 2005, section 3). Points are centred and scaled
    first (Hartley, IEEE Trans. PAMI 19(6), 1997, section 6). One further pass divides the
    equations by ``h3 · m``, so that their residuals are those of the image points.

    Parameters
    ----------
    points : (M, 3) array
        Points of the board in its own frame, mm; z is taken as 0.
    uv : (N, M, 2) array
        Image points, px or normalised; NaN where not seen. They must be free of distortion for
        the map to be exact.

    Returns
    -------
    (N, 3, 3) array
        Of Frobenius norm 1, with ``h3 · m > 0`` for the seen points. NaN where a view shows
        fewer than four points, or all of them, or all but one, on one line.

    Examples
    --------
    >>> board = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    >>> H = homographies(board, 3.0 * board[None, :, :2] + [5.0, 7.0])[0]
    >>> (H / H[2, 2]).round(9) + 0.0
    array([[3., 0., 5.],
           [0., 3., 7.],
           [0., 0., 1.]])
    """
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    weight = seen.astype(float)
    m, to_board = _centred(np.broadcast_to(points[:, :2], uv.shape), weight)
    p, to_image = _centred(np.where(seen[..., None], uv, 0.0), weight)
    whole = np.full((len(uv), 3, 3), np.nan)
    there = _spans_the_plane(m, weight)
    whole[there] = _homographies(m[there], p[there], weight[there])
    whole = np.linalg.inv(to_image) @ whole @ to_board
    return whole / np.linalg.norm(whole, axis=(1, 2), keepdims=True)


def gives_homography(points: Array, uv: Array) -> np.ndarray:
    """Mask ``(N,)`` of the views that have one; arguments as for `homographies`."""
    weight = np.asarray(np.isfinite(uv).all(axis=-1)).astype(float)
    m, _ = _centred(np.broadcast_to(points[:, :2], uv.shape), weight)
    return _spans_the_plane(m, weight)


def _homographies(m: Array, p: Array, weight: Array) -> Array:
    """`homographies` of centred points."""
    whole = _linear_maps(m, p, weight)
    depth = _depths(whole, m, weight)
    possible = np.asarray((depth > 0).all(axis=1))
    again = _linear_maps(m[possible], p[possible], weight[possible] / depth[possible])
    whole[possible] = again
    _depths(whole, m, weight)
    return whole


def _centred(points: Array, weight: Array) -> tuple[Array, Array]:
    """Points ``(N, M, 3)`` made homogeneous with mean 0 and mean distance √2 in each view, and
    the similarities ``(N, 3, 3)`` that make them so."""
    count = np.maximum(weight.sum(axis=1), 1.0)
    middle = np.einsum("nm,nmi->ni", weight, points) / count[:, None]
    offset = points - middle[:, None]
    spread = np.sum(weight * np.linalg.norm(offset, axis=-1), axis=1) / count
    scale = np.sqrt(2.0) / np.where(spread > 0, spread, 1.0)
    homogeneous = np.ones((*points.shape[:2], 3))
    homogeneous[..., :2] = scale[:, None, None] * offset
    similarity = np.zeros((len(points), 3, 3))
    similarity[:, 0, 0] = similarity[:, 1, 1] = scale
    similarity[:, :2, 2] = -scale[:, None] * middle
    similarity[:, 2, 2] = 1.0
    return homogeneous, similarity


def _spans_the_plane(m: Array, weight: Array) -> np.ndarray:
    """Mask ``(N,)`` of views with four points of which no three are on one line.

    Without such four, all points or all but one are on a line. That one then has leverage
    ``mᵀ (Σ m mᵀ)⁻¹ m = 1`` on any linear fit to the points.
    """
    moment = np.swapaxes(m, 1, 2) @ (weight[..., None] * m)
    thin = np.linalg.eigvalsh(moment)
    flat = (weight.sum(axis=1) < _FEWEST) | ~(thin[:, 0] > _FLAT * thin[:, 2])
    moment[flat] = np.eye(3)
    leverage = np.einsum("nmi,nim->nm", m, np.linalg.solve(moment, np.swapaxes(m, 1, 2)))
    return ~flat & ((weight == 0) | (leverage < 1.0 - _FLAT)).all(axis=1)


def _linear_maps(m: Array, p: Array, weight: Array) -> Array:
    """Least-squares maps ``(N, 3, 3)`` of homogeneous points ``(N, M, 3)``, each equation
    multiplied by the weight ``(N, M)`` of its point."""
    turned = np.swapaxes((weight**2)[..., None] * m, 1, 2)
    u, v = p[..., :1], p[..., 1:2]
    mixed = turned @ np.concatenate([u * m, v * m], axis=-1)
    rows = np.linalg.solve(turned @ m, mixed)  # h1 and h2 by h3
    square = turned @ ((u**2 + v**2) * m)
    first, second = rows[..., :3], rows[..., 3:]
    rest = square - np.swapaxes(mixed[..., :3], 1, 2) @ first
    rest -= np.swapaxes(mixed[..., 3:], 1, 2) @ second
    third = np.linalg.eigh(0.5 * (rest + np.swapaxes(rest, 1, 2)))[1][..., :1]
    whole = np.stack([(first @ third)[..., 0], (second @ third)[..., 0], third[..., 0]], axis=1)
    return whole / np.linalg.norm(whole, axis=(1, 2), keepdims=True)


def _depths(whole: Array, m: Array, weight: Array) -> Array:
    """Depths ``h3 · m`` ``(N, M)``, the maps' signs turned, in place, so that most points lie in
    front; 1 for points that are not seen."""
    depth = (m @ whole[:, 2, :, None])[..., 0]
    sign = np.where(np.sum(weight * depth, axis=1) < 0, -1.0, 1.0)
    whole *= sign[:, None, None]
    return np.where(weight > 0, depth * sign[:, None], 1.0)


def pose_from_homography(K: Array, H: Array) -> tuple[Array, Array]:
    """Poses of a board from its homographies, for a known camera.

    ``K⁻¹ H = λ [r1 r2 t]`` (Zhang, 2000, section 3.1). The rotation is the one nearest to the
    first two columns in the Frobenius norm, ``U Vᵀ`` of their singular value decomposition; λ is
    the mean of their singular values, which is the best scale for that rotation.

    Parameters
    ----------
    K : (3, 3) array
        Camera matrix; the identity for homographies to the normalised image.
    H : (N, 3, 3) array
        With the sign that `homographies` gives: positive third coordinates are in front.

    Returns
    -------
    rotations : (N, 3, 3), and translations : (N, 3), mm
        ``X_camera = R X_board + t``; NaN where H is.
    """
    maps = np.linalg.solve(np.broadcast_to(K, H.shape), H)
    there = np.isfinite(maps).all(axis=(1, 2))
    rotations = np.full(maps.shape, np.nan)
    translations = np.full(maps.shape[:2], np.nan)
    u, size, vt = np.linalg.svd(maps[there, :, :2], full_matrices=False)
    first, second = np.moveaxis(u @ vt, -1, 0)
    rotations[there] = np.stack([first, second, np.cross(first, second)], axis=-1)
    translations[there] = maps[there, :, 2] / size.mean(axis=1, keepdims=True)
    return rotations, translations


def other_pose(
    xy: Array, points: Array, rotations: Array, translations: Array
) -> tuple[Array, Array]:
    """The other pose in which a board would look almost the same.

    Seen from afar, a plane may be mirrored in the plane across the line of sight: with D =
    diag(1, 1, −1) and a frame V whose third axis is the line of sight to the board's middle,
    ``R' = V D Vᵀ R D`` leaves the image of a small piece of the board as it is. These are the
    two solutions of Collins and Bartoli, "Infinitesimal plane-based pose estimation", Int. J.
    Computer Vision 109(3), 2014, eqs. 18–20; Schweighofer and Pinz, "Robust pose estimation from
    a planar target", IEEE Trans. PAMI 28(12), 2006, show that the error has a second minimum
    there. The translation is the least-squares solution of ``x (r3·X + t3) = r1·X + t1``,
    ``y (r3·X + t3) = r2·X + t2``.

    It is a start: refined, it tells by its residuals which of the two poses the picture shows.
    Where the board faces the camera, both are one.

    Parameters
    ----------
    xy : (N, M, 2) array
        Ideal normalised image points (K and distortion taken off); NaN where not seen.
    points : (M, 3) array
        Points of the board in its own frame, z = 0, mm.
    rotations : (N, 3, 3) array, and translations : (N, 3) array
        A first pose of the board in each view.

    Returns
    -------
    rotations : (N, 3, 3), and translations : (N, 3), mm
        The translation is NaN where a view shows fewer than three points.
    """
    seen = np.asarray(np.isfinite(xy).all(axis=-1))
    weight = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    middle = (rotations @ (weight @ points)[..., None])[..., 0] + translations
    sight = normalised(middle)
    frame = np.stack([*tangent_basis(sight), sight], axis=-1)
    mirror = np.diag([1.0, 1.0, -1.0])
    other = frame @ mirror @ np.swapaxes(frame, 1, 2) @ rotations @ mirror
    return other, _translations(np.where(seen[..., None], xy, 0.0), points, other, seen)


def _translations(xy: Array, points: Array, rotations: Array, seen: np.ndarray) -> Array:
    """Translations ``(N, 3)`` that best fit given rotations."""
    turned = points @ np.swapaxes(rotations, 1, 2)
    weight = seen.astype(float)
    right = turned[..., :2] - xy * turned[..., 2:]
    count = weight.sum(axis=1)
    normal = np.zeros((len(xy), 3, 3))
    normal[:, 0, 0] = normal[:, 1, 1] = count
    normal[:, :2, 2] = normal[:, 2, :2] = -np.einsum("nm,nmi->ni", weight, xy)
    normal[:, 2, 2] = np.einsum("nm,nmi->n", weight, xy**2)
    pull = np.empty((len(xy), 3))
    pull[:, :2] = -np.einsum("nm,nmi->ni", weight, right)
    pull[:, 2] = np.einsum("nm,nmi,nmi->n", weight, xy, right)
    loose = (count < 3) | ~(np.linalg.det(normal) > 0)
    normal[loose], pull[loose] = np.eye(3), np.nan
    return np.linalg.solve(normal, pull[..., None])[..., 0]
