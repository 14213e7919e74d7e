"""A plane fitted to points in space, and how flat they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.estimation.ransac import consensus
from sheetoflight.geometry.directions import Array

_FEWEST = 3
_DRAWS, _SEED = 1000, 0
_ROUNDS = 200

# Points whose second extent is below this part of the first lie on a line.
_ON_A_LINE = 1e-9


@dataclass(frozen=True, eq=False)
class SpacePlane:
    """A plane ``n · X = d`` fitted to points in space.

    Parameters
    ----------
    normal : (3,) array
        Unit normal.
    distance_mm : float
        Distance from the origin, 0 or more, mm.
    rms_mm : float
        Root mean square distance of the inliers from the plane, mm.
    flatness_mm : float
        Highest less lowest inlier over the fitted plane, mm: flatness by the least-squares
        reference plane (ISO 12781-1). The zone of least width is a little narrower.
    inliers : (N,) bool array
        The points that the plane was fitted to.
    residuals_mm : (N,) array
        ``n · X − d`` of every point, mm.
    """

    normal: Array
    distance_mm: float
    rms_mm: float
    flatness_mm: float
    inliers: NDArray[np.bool_]
    residuals_mm: Array


def fitted_plane_in_space(
    xyz: Array, std: Array | None = None, robust_mm: float | None = None
) -> SpacePlane:
    """The plane through points by least squares of their distances from it.

    With `robust_mm` the plane that most points lie near is sought first (`consensus`), and fitted
    to the points within `robust_mm` again and again, until these are the same as before. The
    result then does not depend on the draws.

    Parameters
    ----------
    xyz : (N, 3) array
        Points, mm.
    std : (N,) array, optional
        Standard uncertainty of each point across the plane, mm; all alike where absent.
    robust_mm : float, optional
        Distance from the plane beyond which a point is no part of it, mm. All points are part of
        it where absent.

    Raises
    ------
    InputError
        If there are fewer than three points, they are not finite, an uncertainty or `robust_mm`
        is not positive, or the shapes do not match.
    UntrustworthyError
        If the points lie on one line.

    Examples
    --------
    >>> x, y = np.indices((5, 5)).reshape(2, -1)
    >>> plane = fitted_plane_in_space(np.stack([x, y, 100.0 + 0.0 * x], axis=-1))
    >>> plane.normal.round(6), round(plane.distance_mm, 6)
    (array([0., 0., 1.]), 100.0)
    """
    xyz = np.asarray(xyz, dtype=float)
    weight = _weights(xyz, std)
    inliers = np.ones(len(xyz), dtype=bool)
    if robust_mm is not None:
        inliers = _near_the_plane(xyz, weight, robust_mm)
    normal, distance = _weighted_plane(xyz[inliers], weight[inliers])
    residuals = xyz @ normal - distance
    return SpacePlane(
        normal=normal,
        distance_mm=distance,
        rms_mm=float(np.sqrt(np.mean(np.square(residuals[inliers])))),
        flatness_mm=float(np.ptp(residuals[inliers])),
        inliers=inliers,
        residuals_mm=residuals,
    )


def _weights(xyz: Array, std: Array | None) -> Array:
    """Inverse variances ``(N,)`` up to a common factor, once all input has been looked at."""
    if xyz.ndim != 2 or xyz.shape[1] != 3 or len(xyz) < _FEWEST or not np.isfinite(xyz).all():
        raise InputError(
            f"the points have shape {xyz.shape}, or are not finite",
            f"give {_FEWEST} or more finite points (N, 3)",
        )
    if std is None:
        return np.ones(len(xyz))
    std = np.asarray(std, dtype=float)
    if std.shape != (len(xyz),) or not (np.isfinite(std) & (std > 0)).all():
        raise InputError(
            f"the uncertainties have shape {std.shape} for {len(xyz)} points, or are not positive",
            "give one positive standard uncertainty in mm for each point",
        )
    return np.square(std.min() / std)


def _near_the_plane(xyz: Array, weight: Array, robust_mm: float) -> NDArray[np.bool_]:
    """The points ``(N,)`` within `robust_mm` of the plane that is fitted to these same points."""
    if not (np.isfinite(robust_mm) and robust_mm > 0):
        raise InputError(f"robust_mm is {robust_mm}", "give a distance above 0 in mm")

    def distances(sample: NDArray[np.int64]) -> Array:
        first, second, third = xyz[sample]
        normal = np.cross(second - first, third - first)
        size = float(np.linalg.norm(normal))
        return (xyz - first) @ normal / size if size > 0 else np.full(len(xyz), np.inf)

    rng = np.random.default_rng(_SEED)
    near = consensus(len(xyz), _FEWEST, distances, robust_mm, _DRAWS, rng).inliers
    for _ in range(_ROUNDS):
        normal, distance = _weighted_plane(xyz[near], weight[near])
        nearer = np.abs(xyz @ normal - distance) <= robust_mm
        if np.array_equal(nearer, near):
            break
        near = nearer
    return near


def _weighted_plane(xyz: Array, weight: Array) -> tuple[Array, float]:
    """Unit normal ``(3,)`` and distance ≥ 0 of the plane of least weighted squared distances."""
    centre = weight @ xyz / weight.sum() if len(xyz) else np.zeros(3)
    scaled = np.sqrt(weight)[:, None] * (xyz - centre)
    _, extents, axes = np.linalg.svd(scaled, full_matrices=False)
    if len(xyz) < _FEWEST or extents[1] <= _ON_A_LINE * max(float(extents[0]), 1e-300):
        raise UntrustworthyError(
            "measure",
            f"the {len(xyz)} points of the plane lie on one line",
            "give points that spread in two directions, or a larger robust_mm",
        )
    distance = float(axes[2] @ centre)
    return (axes[2], distance) if distance >= 0 else (-axes[2], -distance)
