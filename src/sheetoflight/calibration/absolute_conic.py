"""Focal length from pairs of pictures of an unknown scene: Kruppa's equations.

The epipolar geometry of two pictures from one camera restricts the dual image of the absolute
conic, ``C = K Kᵀ``: epipolar lines that touch it in one picture correspond to such lines in the
other. With ``F = U diag(r, s, 0) Vᵀ`` and ``x2ᵀ F x1 = 0`` this reads (R. Hartley, "Kruppa's
equations derived from the fundamental matrix", IEEE Trans. PAMI 19(2), 1997; Lourakis and
Deriche, INRIA report 3911, 2000, eq. 13)::

    r² v1ᵀ C v1 : r s v1ᵀ C v2 : s² v2ᵀ C v2  =  u2ᵀ C u2 : −u1ᵀ C u2 : u1ᵀ C u1

Square pixels and a principal point in the picture's middle leave one unknown, which many pairs
determine well enough for a start. Moves without a turn, turns without a move, and flat scenes
leave it open. Nothing here has a scale: no lengths in mm, and no sheet of light, can be had.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sheetoflight.geometry.directions import Array

_FEWEST = 8
_REWEIGHTINGS = 4
_FOCAL_LENGTHS = np.geomspace(0.25, 16.0, 240)
"""In units of the frame of the fundamental matrices, half diagonals of the picture."""

_FLAT = 1e-9
"""Part of its greatest value by which a cost that depends on the focal length must vary."""

_STOP = 1e-15


def fundamental_matrix(first: Array, second: Array) -> Array | None:
    """``F`` ``(3, 3)`` of Frobenius norm 1 with ``x2ᵀ F x1 = 0``, det F = 0.

    The eight-point algorithm on centred and scaled points (R. Hartley, "In defense of the
    eight-point algorithm", IEEE Trans. PAMI 19(6), 1997), each equation divided by the length of
    its gradient at the last estimate, so that its residual is Sampson's distance, px (*Multiple
    View Geometry*, 2nd ed., eq. 11.9).

    Parameters
    ----------
    first, second : (M, 2) arrays
        Matched image points; pairs with NaN are left out.

    Returns
    -------
    (3, 3) array, or None where there are fewer than eight pairs.
    """
    both = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    if both.sum() < _FEWEST:
        return None
    x1, to_first = _centred(first[both])
    x2, to_second = _centred(second[both])
    rows = (x2[:, :, None] * x1[:, None, :]).reshape(-1, 9)
    weight, F = np.ones(len(rows)), np.eye(3)
    for _ in range(_REWEIGHTINGS):
        triangle = np.linalg.qr(weight[:, None] * rows, mode="r")
        F = _of_rank_two(np.linalg.svd(triangle)[2][-1].reshape(3, 3))
        gradient = np.hypot(
            np.linalg.norm((x1 @ F.T)[:, :2], axis=1), np.linalg.norm((x2 @ F)[:, :2], axis=1)
        )
        weight = 1.0 / np.maximum(gradient, 1e-3 * np.median(gradient))
    whole = to_second.T @ F @ to_first
    return whole / np.linalg.norm(whole)


def _centred(points: Array) -> tuple[Array, Array]:
    """Homogeneous points ``(M, 3)`` of mean 0 and mean distance √2, and their similarity."""
    middle = points.mean(axis=0)
    spread = float(np.linalg.norm(points - middle, axis=1).mean())
    scale = np.sqrt(2.0) / spread if spread > 0 else 1.0
    whole = np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1.0]])
    return np.column_stack([points, np.ones(len(points))]) @ whole.T, whole


def _of_rank_two(F: Array) -> Array:
    u, size, vt = np.linalg.svd(F)
    return u * [size[0], size[1], 0.0] @ vt


def epipolar_distances(F: Array, first: Array, second: Array) -> Array:
    """Sampson's distances ``(M,)`` of matched points ``(M, 2)`` from an epipolar geometry, in the
    units of the points."""
    x1 = np.column_stack([first, np.ones(len(first))])
    x2 = np.column_stack([second, np.ones(len(second))])
    lines_2, lines_1 = x1 @ F.T, x2 @ F
    gradient = np.sum(lines_2[:, :2] ** 2 + lines_1[:, :2] ** 2, axis=1)
    return np.sum(x2 * lines_2, axis=1) / np.sqrt(gradient)


def kruppa_residuals(fundamentals: Array, conics: Array) -> Array:
    """How far conics are from Kruppa's equations.

    Both sides' triples are the entries of a symmetric 2 x 2 matrix; what is compared are these
    matrices at norm 1, so no ratio has a vanishing denominator.

    Parameters
    ----------
    fundamentals : (P, 3, 3) array
    conics : (Q, 3, 3) array
        ``C = K Kᵀ`` of Q cameras, in the same frame.

    Returns
    -------
    (Q, 3 P) array
        Without unit, 0 where the equations hold.
    """
    u, size, vt = np.linalg.svd(fundamentals)
    left = vt[:, None, :2] * size[:, None, :2, None]
    right = np.stack([u[:, :, 1], -u[:, :, 0]], axis=1)[:, None]
    sides = []
    for pair in (left, right):
        form = pair @ conics @ np.swapaxes(pair, 2, 3)
        triple = np.stack([form[..., 0, 0], np.sqrt(2.0) * form[..., 0, 1], form[..., 1, 1]], -1)
        sides.append(triple / np.linalg.norm(triple, axis=-1, keepdims=True))
    return np.swapaxes(sides[0] - sides[1], 0, 1).reshape(len(conics), -1)


def kruppa_focal_lengths(fundamentals: Sequence[Array]) -> list[float]:
    """Focal lengths at which Kruppa's equations have a least-squares minimum, the best first.

    Parameters
    ----------
    fundamentals : sequence of (3, 3) arrays
        In a frame with the principal point at 0 and square pixels.

    Returns
    -------
    list of float
        In the units of that frame; empty where the cost does not depend on the focal length, or
        falls towards an end of the range.
    """
    from scipy.optimize import least_squares

    maps = np.stack(fundamentals)

    def residuals(log_focal: Array) -> Array:
        return kruppa_residuals(maps, _conics(np.exp(log_focal)))[0]

    logs = np.log(_FOCAL_LENGTHS)
    costs = np.sum(kruppa_residuals(maps, _conics(_FOCAL_LENGTHS)) ** 2, axis=1)
    if np.ptp(costs) <= _FLAT * max(float(costs.max()), _FLAT):
        return []
    inner = np.flatnonzero((costs[1:-1] < costs[:-2]) & (costs[1:-1] <= costs[2:])) + 1
    found = []
    for place in inner:
        bounds = (logs[place - 1], logs[place + 1])
        best = least_squares(
            residuals, logs[place], bounds=bounds, xtol=_STOP, ftol=_STOP, gtol=_STOP
        )
        found.append((float(best.cost), float(np.exp(best.x[0]))))
    return [focal for _, focal in sorted(found)]


def _conics(focal_lengths: Array) -> Array:
    """``K Kᵀ`` ``(Q, 3, 3)`` of square pixels with the principal point at 0."""
    conics = np.zeros((len(focal_lengths), 3, 3))
    conics[:, 0, 0] = conics[:, 1, 1] = focal_lengths**2
    conics[:, 2, 2] = 1.0
    return conics
