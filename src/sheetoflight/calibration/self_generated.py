"""A sheet of light from a plate that a stage moves by known steps.

The light draws its own target: lines on a bare plate, of which the stage knows the distances. The
methods here are derived, not taken from a paper; the paper that calls this the self-generated
target method was not at hand.

What the lines alone tell
-------------------------
Let the sheet be ``n · X = d`` and the plate, after a travel s in a fixed direction e,
``m · X = c + s q`` with ``q = m · e``; n, d, m, c, q are unknown, the camera is known. The plane
through the camera's centre and the line of light is ``ℓ · X = 0`` with

    ℓ(s) ∝ (c + s q) n − d m ∝ s N − M,   N = (q / d) n,   M = m − (c / d) n.

All image lines pass through one point, and (N, M) is seen up to one common factor: five numbers.
Of the seven unknowns

- the normal n is determined, being parallel to N: it is the line of infinite travel, where any
  plate meets the sheet in the sheet's vanishing line. This takes three steps or more, and only
  the ratios of the travels;
- so is the direction of the lines, ``n × m``;
- the distance is not. ``d = κ ‖M⊥‖ / ‖N‖``, M⊥ being the part of M across n, with
  ``κ = |q| / sin φ``, φ the angle between plate and sheet. κ is the distance between lines in
  the sheet for one mm of travel, and no image of lines tells it;
- nor are φ, q and c, each alone.

κ = 1 where the travel lies in the sheet, at a right angle to the lines. A plate that travels along
its own normal has κ = 1 / sin φ, so that this alone is not enough.

What points tell
----------------
With a known length along the line too, as between the edges of a plate of known width, every step
gives points of known coordinates (x across the plate, y by the travel) in the sheet. Their
homography to the image holds the whole plane (`self_generated_plane`), and two numbers over that
check the coordinates.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.board_closed_form import homographies, pose_from_homography
from sheetoflight.calibration.control_points import ControlledSheet
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array

_ROUNDING = 1e-9
"""Singular value of the equations, as a part of the first, that is still rounding."""

_APART = 3.0
"""How much worse than the best solution the next one must fit: less, and noise chose."""

_LEAST_WEIGHED = 1e-3
"""Length of a line's first two parts, as a part of the greatest, below which none counts more."""

OUT_OF_SQUARE = 0.05
"""Greatest difference of scale between the two axes of the sheet, as seen, that noise may cause."""


def sheet_of_stepped_lines(xy: Array, travel_mm: Array, spacing: float) -> ControlledSheet:
    """The sheet from its lines on a plate that travels by known amounts.

    ``r · (s N − M) = 0`` holds for every point ``r = (x, y, 1)`` of the line at travel s and is
    linear in (N, M), which is the right singular vector of the smallest singular value; one
    further pass divides each equation by the length of the first two parts of ``s N − M``, which
    makes the residuals distances in the image. See the head of this module for what follows.

    The normal rests on lines extrapolated to infinite travel: a travel that is a small part of the
    distance makes it uncertain.

    Parameters
    ----------
    xy : (P, 2) array
        Ideal normalised image points of the lines.
    travel_mm : (P,) array
        The stage's position when each was seen.
    spacing : float
        κ, the distance between the lines in the sheet for one mm of travel: 1 where the travel
        lies in the sheet, at a right angle to the lines. No picture holds it; it scales the
        distance, and leaves the normal as it is.

    Raises
    ------
    InputError
        If the shapes disagree, or spacing is not above zero.
    UntrustworthyError
        If there are fewer than three positions of the stage, the line does not move, or the sheet
        found is not before the camera.

    Examples
    --------
    >>> y = np.array([-0.1, 0.1] * 3)
    >>> depth = np.repeat([400.0, 500.0, 600.0], 2)  # travel along z, the sheet x = 50
    >>> xy = np.column_stack([50.0 / depth, y])
    >>> sheet = sheet_of_stepped_lines(xy, depth - 400.0, spacing=1.0)
    >>> sheet.normal.round(9) + 0.0, round(sheet.distance, 6)
    (array([1., 0., 0.]), 50.0)
    """
    if xy.shape != (len(travel_mm), 2):
        raise InputError(
            f"{len(travel_mm)} travels for image points of shape {xy.shape}",
            "give the stage's position for each point",
        )
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(
            f"the spacing of the lines in the sheet is {spacing}",
            "give the mm between lines in the sheet for one mm of travel: 1 where the stage "
            "travels in the sheet, at a right angle to the lines",
        )
    if len(np.unique(travel_mm)) < 3:
        raise UntrustworthyError(
            "plane",
            f"the stage was at {len(np.unique(travel_mm))} places, at least 3 are needed",
            "move the plate on, and take the line again",
        )
    return _sheet_of_pencil(np.column_stack([xy, np.ones(len(xy))]), travel_mm, spacing)


def _sheet_of_pencil(rays: Array, travel: Array, spacing: float) -> ControlledSheet:
    far, near = _pencil(rays, travel)  # where s is counted from changes M along n alone
    steep = float(np.linalg.norm(far))
    normal = far / steep
    facing = rays @ normal
    if facing.sum() < 0:
        normal, facing = -normal, -facing
    if (facing <= 0).any():
        raise UntrustworthyError(
            "plane",
            "the line of infinite travel runs through the lines that were seen",
            "give the travels with their right signs, or move the plate farther",
        )
    across = near - (near @ normal) * normal
    distance = spacing * float(np.linalg.norm(across)) / steep
    return ControlledSheet(normal, distance, rays * (distance / facing)[:, None])


def _pencil(rays: Array, travel: Array) -> tuple[Array, Array]:
    """N and M ``(3,)`` of the lines ``s N − M``, with s counted from the middle travel, per mm of
    travel, up to one common factor."""
    reach = travel.std()
    s = (travel - travel.mean()) / reach
    rows = np.concatenate([s[:, None] * rays, -rays], axis=1)
    # rows of zeros, so that five points too have six singular vectors
    rows = np.pad(rows, ((0, max(0, 6 - len(rows))), (0, 0)))
    _, size, vectors = np.linalg.svd(rows, full_matrices=False)
    if size[4] <= max(_ROUNDING * size[0], _APART * size[5]):
        raise UntrustworthyError(
            "plane",
            "the line of light does not move enough to tell the sheet",
            "let the plate travel farther, and not along itself",
        )
    far, near = np.split(vectors[5], 2)
    length = np.linalg.norm(s[:, None] * far[:2] - near[:2], axis=1)
    rows[: len(s)] /= np.maximum(length, _LEAST_WEIGHED * length.max())[:, None]
    far, near = np.split(np.linalg.svd(rows, full_matrices=False)[2][5], 2)
    return far / reach, near


def self_generated_plane(sheet_points: Array, xy: Array) -> ControlledSheet:
    """The sheet from points of known places in it.

    The homography from the sheet to the normalised image is ``H = λ [r1 r2 t]`` with orthonormal
    r1, r2 (Zhang, IEEE Trans. PAMI 22(11), 2000, eq. 2, for a board that is the sheet itself):
    the normal is ``r1 × r2``, the distance its product with t. The known millimetres give λ.

    Parameters
    ----------
    sheet_points : (P, 2) array
        Coordinates in the sheet, mm, square to each other: x along the lines, as between the
        plate's edges, and y by the travel.
    xy : (P, 2) array
        Their ideal normalised image points; NaN where not seen.

    Raises
    ------
    InputError
        If the shapes disagree.
    UntrustworthyError
        If the points do not span the sheet, or the image shows that the coordinates are not
        square and of one scale: the travel was then askew to the sheet or to the lines.
    """
    H = sheet_homography(sheet_points, xy)
    if out_of_square(H) > OUT_OF_SQUARE:
        raise askew(H)
    rotations, translations = pose_from_homography(np.eye(3), H[None])
    R, t = rotations[0], translations[0]
    distance = float(R[:, 2] @ t)
    sign = -1.0 if distance < 0 else 1.0
    points = sheet_points @ R[:, :2].T + t
    points[~np.isfinite(xy).all(axis=1)] = np.nan
    return ControlledSheet(sign * R[:, 2], sign * distance, points)


def sheet_homography(sheet_points: Array, xy: Array) -> Array:
    """The map ``(3, 3)`` from the sheet's coordinates to the normalised image.

    Parameters
    ----------
    sheet_points, xy : (P, 2) arrays
        As for `self_generated_plane`.

    Raises
    ------
    InputError
        If the shapes disagree.
    UntrustworthyError
        If the points do not span the sheet.
    """
    if sheet_points.shape != xy.shape or sheet_points.shape[1:] != (2,):
        raise InputError(
            f"points of the sheet have shape {sheet_points.shape}, image points {xy.shape}",
            "give two coordinates of each in both",
        )
    maps = homographies(sheet_points, xy[None])
    if not np.isfinite(maps).all():
        raise UntrustworthyError(
            "plane",
            "the points seen of the sheet are fewer than four, or lie on one line",
            "take the line's ends at two positions of the stage or more",
        )
    return maps[0]


def out_of_square(H: Array) -> float:
    """By how much the axes of the sheet differ in scale, or are not square, as the map sees it: a
    part of 1."""
    great, small = np.linalg.svd(H[:, :2], compute_uv=False)
    return float(1.0 - small / great)


def askew(H: Array) -> UntrustworthyError:
    """The refusal of such a map."""
    return UntrustworthyError(
        "plane",
        f"the sheet's coordinates are out of square by {out_of_square(H):.1%} as seen "
        f"(limit {OUT_OF_SQUARE:.0%})",
        "give mm within the sheet: a travel askew to the sheet or to the lines is not that, "
        "and check the camera",
    )
