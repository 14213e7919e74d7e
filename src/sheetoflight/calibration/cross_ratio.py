"""A sheet of light from the invariance of the cross-ratio.

A printed line of a target holds three or more known points. The line of light crosses it in a
point whose place along it is not known, but the cross-ratio of four collinear points is the same
in the picture as in space, and fixes it. Such control points, on all faces of a solid target and
in all views, span the sheet. D. Huynh, R. Owens and P. Hartmann, "Calibrating a structured light
stripe system: a novel approach", Int. J. Computer Vision 33(1), 1999; Z. Wei, G. Zhang and Y. Xu,
"Calibration approach for structured-light-stripe vision sensor based on the invariance of double
cross-ratio", Optical Engineering 42, 2003, p. 2956. Abstracts alone were at hand, so no equation
number is given. Huynh's 4 x 3 map from the image to the world is not made here: with the target's
pose before a known camera, the points give the plane.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.control_points import ControlledSheet, controlled_sheet, placed
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array

_GLANCING = 0.02
"""Sine of the angle in the picture below which the crossing's place along the line is noise."""

_ROUNDING = 1e-9
"""Singular value of a map's equations, as a part of the first, that is still rounding."""

_STRAIGHT = 1e-6
"""Extent of known points across their line, as a part of that along it, that still counts as
collinear."""


def positions_of_crossings(positions: Array, xy: Array, stripes: Array) -> Array:
    """Where along known lines the line of light crosses them.

    Positions s of a line and w of its image are related by ``w = (p s + q) / (r s + t)``. Three
    known points fix the map, and the fourth then has the same cross-ratio in both; more than
    three fix it by least squares of ``w (r s + t) − (p s + q)``, s and w centred and scaled.

    Parameters
    ----------
    positions : (L, M) array
        Positions of the M known points along each line, mm.
    xy : (L, M, 2) array
        Their ideal normalised image points; NaN where not seen. They are moved onto their common
        line first.
    stripes : (L, 3) array
        ``ℓ`` with ``ℓ · (x, y, 1) = 0`` for the line of light on the face of each line.

    Returns
    -------
    (L,) array
        In mm; NaN where fewer than three points are seen, the light crosses at less than about a
        degree, or behind the camera.

    Examples
    --------
    >>> known = np.array([[0.0, 10.0, 20.0]])
    >>> image = np.array([[[0.0, 0], [10 / 110, 0], [20 / 120, 0]]])  # x = s / (100 + s)
    >>> positions_of_crossings(known, image, np.array([[1.0, 0.0, -15 / 115]])).round(9)
    array([15.])
    """
    weight = np.isfinite(xy).all(axis=-1).astype(float)
    w, crossing = _along_image(xy, weight, stripes)
    s, s_mean, s_size = _standard(np.where(weight > 0, positions, 0.0), weight)
    w, w_mean, w_size = _standard(w, weight)
    rows = np.stack([s, np.ones_like(s), -w * s, -w], axis=-1)
    # rows of zeros, so that three points too have four singular vectors
    rows = np.pad(weight[..., None] * rows, ((0, 0), (0, 2), (0, 0)))
    _, size, vectors = np.linalg.svd(rows, full_matrices=False)
    p, q, r, t = vectors[:, 3].T
    # two points, or three of which two are one, leave more than one map
    there = (size[:, 2] > _ROUNDING * size[:, 0]) & np.isfinite(crossing)
    at = (crossing - w_mean) / w_size
    with np.errstate(divide="ignore", invalid="ignore"):
        place = (q - t * at) / (r * at - p)
        depth_there = r * place + t
    depth = r[:, None] * s + t[:, None]
    side = np.sign(np.sum(weight * depth, axis=1))
    in_front = depth_there * side > 0
    seen_in_front = ((depth * side[:, None] > 0) | (weight == 0)).all(axis=1)
    return np.where(there & in_front & seen_in_front, s_mean + s_size * place, np.nan)


def _along_image(xy: Array, weight: Array, stripes: Array) -> tuple[Array, Array]:
    """Coordinates ``(L, M)`` of image points along their total least-squares lines, and ``(L,)``
    of the stripes' crossings; NaN where these are glancing."""
    count = np.maximum(weight.sum(axis=1), 1.0)[:, None]
    known = np.where(weight[..., None] > 0, xy, 0.0)
    middle = known.sum(axis=1) / count
    offset = weight[..., None] * (known - middle[:, None])
    along = np.linalg.svd(offset, full_matrices=False)[2][:, 0]
    unit = stripes / np.linalg.norm(stripes[:, :2], axis=1, keepdims=True)
    slope = np.sum(unit[:, :2] * along, axis=1)
    height = np.sum(unit[:, :2] * middle, axis=1) + unit[:, 2]
    clear = np.abs(slope) > _GLANCING
    crossing = np.where(clear, -height / np.where(clear, slope, 1.0), np.nan)
    return np.einsum("lmi,li->lm", offset, along), crossing


def _standard(values: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Values ``(L, M)`` with mean 0 and mean square 1 in each line, the means and the scales."""
    count = np.maximum(weight.sum(axis=1), 1.0)
    mean = np.sum(weight * values, axis=1) / count
    offset = weight * (values - mean[:, None])
    size = np.sqrt(np.sum(offset**2, axis=1) / count)
    size = np.where(size > 0, size, 1.0)
    return offset / size[:, None], mean, size


def cross_ratio_points(points: Array, xy: Array, stripes: Array) -> Array:
    """Control points in the target's own frame; no camera and no pose enters.

    Parameters
    ----------
    points : (L, M, 3) array
        The M known points of each line, mm, target's frame.
    xy, stripes
        As for `positions_of_crossings`. The cross-ratio being invariant, pixels will do as well
        as normalised coordinates, the distortion taken off.

    Returns
    -------
    (L, 3) array
        In mm, target's frame; NaN where there is none.

    Raises
    ------
    InputError
        If the known points of a line are not collinear.
    """
    middle = points.mean(axis=1)
    offset = points - middle[:, None]
    _, size, vectors = np.linalg.svd(offset, full_matrices=False)
    bent = np.flatnonzero(size[:, 1] > _STRAIGHT * size[:, 0])
    if bent.size:
        raise InputError(
            f"the known points of line {bent[0]} are not on one straight line",
            "name points of one straight line of the target",
        )
    along = vectors[:, 0]
    positions = np.einsum("lmi,li->lm", offset, along)
    place = positions_of_crossings(positions, xy, stripes)
    return middle + place[:, None] * along


def cross_ratio_sheet(
    points: Array, xy: Array, stripes: Array, camera_from_target: Array
) -> ControlledSheet:
    """The plane through the control points of all faces and views.

    One view is enough where two faces at an angle carry lines.

    Parameters
    ----------
    points, xy, stripes
        As for `cross_ratio_points`; xy normalised.
    camera_from_target : (L, 3, 4) array
        Pose ``[R t]`` of the target in the view of each line, mm.

    Raises
    ------
    InputError
        If the known points of a line are not collinear.
    UntrustworthyError
        If fewer than three lines are crossed, all of these lie in one plane, or the control
        points lie on one line.
    """
    own = cross_ratio_points(points, xy, stripes)
    crossed = np.isfinite(own).all(axis=1)
    if not crossed.any():
        raise UntrustworthyError(
            "plane",
            "no line of the target with three known points in sight is crossed by the light",
            "turn the target so that the light crosses its printed lines",
        )
    carriers = placed(points[crossed], camera_from_target[crossed]).reshape(-1, 3)
    return controlled_sheet(placed(own, camera_from_target), carriers)
