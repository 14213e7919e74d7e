"""Camera candidates in closed form, from pivoting targets and sheets seen at once.

Z. Zhang, "Camera calibration with one-dimensional objects", IEEE Trans. PAMI 26(7), 2004; the
paper's section 3.1. The markers of a pivoting view are ``X = A + s t``, so their image points are
``m ~ ã + s v`` with the fixed point's image ``ã`` (third component 1) and ``v = K t / Z_A``. Every
marker gives two linear equations for ``v``: this is the paper's eq. 10 (``h = -(l1 + l2) v``) for
any number of markers. From ``‖t‖ = 1`` follows one linear equation a view, ``vᵀ W v = 1`` with
``W = Z_A² K⁻ᵀ K⁻¹`` (eq. 13). A sheet of light whose metric homography to the image is
``[h1 h2 h3]`` adds ``h1ᵀ W h2 = 0`` and ``h1ᵀ W h1 = h2ᵀ W h2``, the images of its circular
points (Zhang, IEEE Trans. PAMI 22(11), 2000): also where the swings alone are degenerate, the
two kinds of equations together may give the camera. K follows from W's Cholesky factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, normalised

_REWEIGHTINGS = 3


@dataclass(frozen=True)
class PivotImages:
    """What the views of a pivoting target show, in normalised pixels and lengths.

    Parameters
    ----------
    anchor : (3,) array
        Homogeneous image ã of the fixed point.
    slopes : (N, 3) array
        v of every view; the shortest of many for views with fewer than two far markers.
    full : (N,) mask
        Views with at least two far markers.
    """

    anchor: Array
    slopes: Array
    full: np.ndarray

    def depth(self, matrix: Array) -> float:
        """Z_A for a camera: ``Z_A ‖K⁻¹ v‖ = 1`` in the median of the views."""
        lengths = np.linalg.norm(self.slopes[self.full] @ np.linalg.inv(matrix).T, axis=1)
        return float(1.0 / np.median(lengths))

    def directions(self, matrix: Array) -> Array:
        """t ``(N, 3)`` for a camera."""
        return normalised(self.slopes @ np.linalg.inv(matrix).T)


def normalisation(uv: Array) -> Array:
    """Similarity ``(3, 3)`` of pixels that makes the points' mean distance √2 (Hartley, 1997).

    Isotropic, so that zero skew and square pixels stay what they are.
    """
    points = uv[np.isfinite(uv).all(axis=-1)]
    centre = points.mean(axis=0)
    spread = float(np.mean(np.linalg.norm(points - centre, axis=1)))
    scale = np.sqrt(2.0) / spread if spread > 0 else 1.0
    return np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1.0]])


def pivot_images(points: Array, positions: Array) -> PivotImages | None:
    """``ã`` and ``v`` of every view by least squares of ``s v_xy − s v_z u = u − a``.

    The equations are multiplied by the marker's depth ratio ``1 + s v_z``; dividing by the last
    estimate of it makes the residuals those of the image points.

    Parameters
    ----------
    points : (N, M, 2) array
        Normalised image points; NaN where not seen.
    positions : (M,) array
        Marker positions from the fixed point, in units of the target's length.

    Returns
    -------
    PivotImages, or None where no view shows marker 0.
    """
    seen = np.asarray(np.isfinite(points).all(axis=-1))
    if not seen[:, 0].any():
        return None
    anchor = np.nanmedian(points[seen[:, 0], 0], axis=0)
    seen = seen & (positions > 0)
    u = np.where(seen[..., None], points, 0.0)
    ratio = np.ones(points.shape[:2])
    slopes = np.zeros((len(points), 3))
    for _ in range(_REWEIGHTINGS):
        weight = np.where(seen, 1.0 / ratio, 0.0)
        rows = np.zeros((*points.shape[:2], 2, 3))
        rows[..., 0, 0] = rows[..., 1, 1] = weight * positions
        rows[..., 2] = -(weight * positions)[..., None] * u
        right = weight[..., None] * np.where(seen[..., None], u - anchor, 0.0)
        system = rows.reshape(len(points), -1, 3)
        slopes = (np.linalg.pinv(system) @ right.reshape(len(points), -1, 1))[..., 0]
        ratio = np.maximum(1.0 + positions * slopes[:, 2:], 0.05)
    return PivotImages(np.append(anchor, 1.0), slopes, seen.sum(axis=1) >= 2)


def closed_form_cameras(
    slopes: Array, sheets: Sequence[Array], middle: Array, skew: bool
) -> Iterator[Array]:
    """All K that the linear equations give, from the most general to the most reduced model.

    Parameters
    ----------
    slopes : (N, 3) array
        v of the pivoting views, normalised.
    sheets : sequence of (3, 3) arrays
        Homographies from each sheet to the normalised image.
    middle : (2,) array
        The picture's centre, normalised: principal point of the most reduced camera.
    skew : bool
        Whether to try a camera with skew.

    Yields
    ------
    (3, 3) array
        None where no W is positive definite: the evidence is degenerate, or too noisy for a
        closed form.
    """
    for basis in _camera_models(middle, skew):
        matrix = _camera(slopes, sheets, basis)
        if matrix is not None:
            yield matrix


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


def _camera(slopes: Array, sheets: Sequence[Array], basis: list[Array]) -> Array | None:
    """K in normalised units, or None if no positive definite W fits."""
    rows = [np.stack([np.einsum("ni,ij,nj->n", slopes, b, slopes) for b in basis], axis=1)]
    right = [np.ones(len(slopes))]
    for homography in sheets:
        h1, h2, _ = (homography / np.linalg.norm(homography[:, :2])).T
        weight = float(np.sqrt(max(len(slopes), 1)))
        circular = [[h1 @ b @ h2, h1 @ b @ h1 - h2 @ b @ h2] for b in basis]
        rows.append(weight * np.array(circular).T)
        right.append(np.zeros(2))
    system, values = np.concatenate(rows), np.concatenate(right)
    if not len(slopes):  # the scale of W is open: any will do for K
        system = np.concatenate([system, [[np.trace(b) for b in basis]]])
        values = np.append(values, 1.0)
    if len(system) < len(basis):
        return None
    weights, _, rank, _ = np.linalg.lstsq(system, values, rcond=1e-10)
    if rank < len(basis):
        return None
    try:
        upper = np.linalg.cholesky(np.tensordot(weights, np.stack(basis), axes=1)).T
    except np.linalg.LinAlgError:
        return None
    matrix = np.linalg.inv(upper)
    return matrix / matrix[2, 2]
