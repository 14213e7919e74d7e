"""Camera from a target that pivots about a fixed point, in closed form.

Z. Zhang, "Camera calibration with one-dimensional objects", IEEE Trans. PAMI 26(7), 2004; the
paper's section 3.1. The markers of a view are ``X = A + s t``, so their image points are
``m ~ ã + s v`` with the fixed point's image ``ã`` (third component 1) and
``v = K t / Z_A``. Every marker gives two linear equations for ``v``: this is the paper's eq. 10
(``h = -(l1 + l2) v``) for any number of markers. From ``‖t‖ = 1`` follows one linear equation
a view, ``vᵀ W v = 1`` with ``W = Z_A² K⁻ᵀ K⁻¹`` (eq. 13), and K from W's Cholesky factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised

_REWEIGHTINGS = 3


@dataclass(frozen=True)
class PivotStart:
    """A first camera, fixed point (mm) and target directions ``(N, 3)``."""

    matrix: Array
    anchor: Array
    directions: Array


def pivot_starts(
    uv: Array, positions: Array, image_size: tuple[int, int], skew: bool
) -> list[PivotStart]:
    """All cameras that the linear equations give, from the most general to the most reduced.

    Parameters
    ----------
    uv : (N, M, 2) array
        Image points in px; NaN where not seen. Marker 0 must be seen in one view at least. Views
        with fewer than two far markers add nothing to the camera; their direction is the
        shortest of many and wants `pose_reselection`.
    positions : (M,) array
        Marker positions from the fixed point, mm.
    image_size : (int, int)
        Its centre is the principal point of the most reduced camera.
    skew : bool
        Whether to try a camera with skew.

    Returns
    -------
    list of PivotStart
        Empty where no W is positive definite: the directions are degenerate or the noise
        is too strong for a closed form.
    """
    centre, scale = _normalisation(uv)
    points = (uv - centre) * scale
    length = float(positions[-1])
    anchor_image = np.nanmean(points[:, 0], axis=0)
    slopes = _direction_images(points, anchor_image, positions / length)
    middle = (0.5 * (np.array(image_size) - 1.0) - centre) * scale
    starts = []
    full = np.isfinite(uv[:, 1:]).all(axis=-1).sum(axis=1) >= 2
    for basis in _camera_models(middle, skew):
        weighted = _whitened_camera(slopes[full], basis)
        if weighted is None:
            continue
        depth, matrix = weighted
        # undo the normalisation of lengths and pixels
        unit_rays = np.linalg.inv(matrix)
        directions = normalised(slopes @ unit_rays.T)
        anchor = length * depth * unit_rays @ np.append(anchor_image, 1.0)
        pixel = np.array([[1 / scale, 0, centre[0]], [0, 1 / scale, centre[1]], [0, 0, 1.0]])
        starts.append(PivotStart(pixel @ matrix, anchor, directions))
    return starts


def _normalisation(uv: Array) -> tuple[Array, float]:
    """Centre and isotropic scale that make the points' mean distance √2 (Hartley, 1997).

    Isotropic, so that zero skew and square pixels stay what they are.
    """
    points = uv[np.isfinite(uv).all(axis=-1)]
    centre = points.mean(axis=0)
    spread = float(np.mean(np.linalg.norm(points - centre, axis=1)))
    return centre, float(np.sqrt(2.0) / spread)


def _direction_images(points: Array, anchor_image: Array, positions: Array) -> Array:
    """``v`` of every view ``(N, 3)``: least squares of ``s v_xy − s v_z u = u − a``.

    The equations are multiplied by the marker's depth ratio ``1 + s v_z``; dividing by the last
    estimate of it makes the residuals those of the image points.
    """
    seen = np.isfinite(points).all(axis=-1) & (positions > 0)
    u = np.where(seen[..., None], points, 0.0)
    ratio = np.ones(points.shape[:2])
    slopes = np.zeros((len(points), 3))
    for _ in range(_REWEIGHTINGS):
        weight = np.where(seen, 1.0 / ratio, 0.0)
        rows = np.zeros((*points.shape[:2], 2, 3))
        rows[..., 0, 0] = rows[..., 1, 1] = weight * positions
        rows[..., 2] = -(weight * positions)[..., None] * u
        right = weight[..., None] * np.where(seen[..., None], u - anchor_image, 0.0)
        system = rows.reshape(len(points), -1, 3)
        slopes = (np.linalg.pinv(system) @ right.reshape(len(points), -1, 1))[..., 0]
        ratio = np.maximum(1.0 + positions * slopes[:, 2:], 0.05)
    return slopes


def _camera_models(middle: Array, skew: bool) -> list[list[Array]]:
    """Bases of the matrices W, from five or six unknowns down to two."""

    def symmetric(row: int, column: int) -> Array:
        matrix = np.zeros((3, 3))
        matrix[row, column] = matrix[column, row] = 1.0
        return matrix

    square = np.diag([1.0, 1.0, 0.0])
    offsets = [symmetric(0, 2), symmetric(1, 2), symmetric(2, 2)]
    no_skew = [symmetric(0, 0), symmetric(1, 1), *offsets]
    shift = np.eye(3)
    shift[:2, 2] = -middle
    centred: list[Array] = [shift.T @ square @ shift, shift.T @ symmetric(2, 2) @ shift]
    general = [[*no_skew, symmetric(0, 1)]] if skew else []
    return [*general, no_skew, [square, *offsets], centred]


def _whitened_camera(slopes: Array, basis: list[Array]) -> tuple[float, Array] | None:
    """``Z_A`` and K in normalised units, or None if no positive definite W fits."""
    if len(slopes) < len(basis):
        return None
    rows = np.stack([np.einsum("ni,ij,nj->n", slopes, b, slopes) for b in basis], axis=1)
    weights, _, rank, _ = np.linalg.lstsq(rows, np.ones(len(rows)), rcond=1e-12)
    if rank < len(basis):
        return None
    try:
        upper = np.linalg.cholesky(np.tensordot(weights, np.stack(basis), axes=1)).T
    except np.linalg.LinAlgError:
        return None
    depth = float(upper[2, 2])
    matrix = np.linalg.inv(upper / depth)
    return depth, matrix / matrix[2, 2]
