"""The picture of one marker as a formula, with its derivatives.

A disc of ink on lighter (or darker) ground, evenly sloping light, smoothed edges::

    I(x) = (w0 + w·(x − x0)) (1 − k Q(x) D(x))
    D = Φ(d/s),  d = signed distance to the outline |L (x − e)| = 1, positive inside
    Q = (1 + erf(l1/√2 s) erf(l2/√2 s)) / 2,  li = n(φi)·(x − c)     quadrant marker
    Q = 1                                                            disc

The outline has a centre ``e`` of its own: under perspective the middle of the ellipse is not the
image of the disc's centre, whereas the crossing ``c`` of the two edges is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import erf

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.candidate import Candidate

OUTLINE = slice(0, 2)
"""Parameters that hold the outline's centre ``e``."""
_FORM = slice(2, 5)
_BLUR, _WHITE, _SLOPE, _INK = 5, 6, slice(7, 9), 9
CROSSING = slice(10, 12)
"""Parameters that hold the crossing ``c`` of a quadrant marker's edges."""
_EDGES = (12, 13)
_DISC_PARAMETERS, _QUADRANT_PARAMETERS = 10, 14


class _Step(NamedTuple):
    """A smoothed step (0 to 1) of a signed distance, and its slope."""

    value: Array
    slope: Array


def starting_parameters(candidate: Candidate, quadrant: bool, blur: float) -> Array:
    """Parameters of the formula for a candidate; its centre is ``x0`` and the origin."""
    values = np.zeros(_QUADRANT_PARAMETERS if quadrant else _DISC_PARAMETERS)
    inverse = np.linalg.inv(candidate.frame)
    values[_FORM] = np.linalg.qr(inverse, mode="r")[np.triu_indices(2)]
    values[_BLUR] = np.log(blur)
    values[_WHITE] = candidate.surround
    values[_INK] = candidate.contrast / candidate.surround
    if quadrant:
        values[_EDGES[0]] = np.arctan2(candidate.frame[1, 0], candidate.frame[0, 0])
        values[_EDGES[1]] = np.arctan2(candidate.frame[1, 1], candidate.frame[0, 1])
    return values


def frame_of(values: Array) -> Array:
    """The outline's and edges' `Candidate.frame`."""
    form = np.zeros((2, 2))
    form[np.triu_indices(2)] = values[_FORM]
    if len(values) == _DISC_PARAMETERS:
        return np.linalg.inv(form)
    unit = np.array([np.cos(values[list(_EDGES)]), np.sin(values[list(_EDGES)])])
    return unit / np.linalg.norm(form @ unit, axis=0)


def contrast_of(values: Array) -> tuple[float, float]:
    """Surround less ink, and the surround, at the marker's centre."""
    return float(values[_WHITE] * values[_INK]), float(values[_WHITE])


def blur_of(values: Array) -> float:
    """Standard deviation of the edges' smoothing, px."""
    return float(np.exp(values[_BLUR]))


def intensity(values: Array, offsets: Array) -> tuple[Array, Array]:
    """Grey values ``(N,)`` at offsets ``(N, 2)`` px from x0, and their derivatives ``(N, P)``."""
    jacobian = np.zeros((len(offsets), len(values)))
    blur = np.exp(values[_BLUR])
    light = values[_WHITE] + offsets @ values[_SLOPE]
    disc, distance = _disc(values, offsets, blur, jacobian)
    ink = values[_INK]
    by_disc = -light * ink * disc.slope
    by_blur = -by_disc * distance
    cover = disc.value
    if len(values) == _QUADRANT_PARAMETERS:
        quarters, by_edges, edge_blur = _quarters(values, offsets, blur)
        cover = cover * quarters
        by_blur = by_blur * quarters + light * ink * disc.value * edge_blur
        by_disc = by_disc * quarters
        jacobian[:, CROSSING.start :] = (-light * ink * disc.value)[:, None] * by_edges
    jacobian[:, :_BLUR] *= by_disc[:, None]
    jacobian[:, _BLUR] = by_blur
    shade = 1.0 - ink * cover
    jacobian[:, _WHITE] = shade
    jacobian[:, _SLOPE] = shade[:, None] * offsets
    jacobian[:, _INK] = -light * cover
    return light * shade, jacobian


def outline_radius(values: Array, offsets: Array) -> Array:
    """Distance ``(N,)`` from the outline's centre, in radii: 1 on the outline."""
    form = np.zeros((2, 2))
    form[np.triu_indices(2)] = values[_FORM]
    return np.linalg.norm((offsets - values[OUTLINE]) @ form.T, axis=-1)


def _disc(values: Array, offsets: Array, blur: float, jacobian: Array) -> tuple[_Step, Array]:
    """Cover by the disc; writes the distance's derivatives by outline into the Jacobian.

    With z = L (x − e) and ρ = |z|, the distance is (1 − ρ)/|∇ρ| = (1 − ρ) ρ/|Lᵀz|, which is
    exact to first order at the outline, where alone it matters.
    """
    a, b, c = values[_FORM]
    x, y = (offsets - values[OUTLINE]).T
    p, q = a * x + b * y, c * y
    h, m = a * p, b * p + c * q
    rho = np.maximum(np.hypot(p, q), 1e-9)
    norm = np.maximum(np.hypot(h, m), 1e-12)
    distance = (1.0 - rho) * rho / norm
    zero = np.zeros_like(x)
    # For each parameter: the derivatives of p and q, and of h and m at fixed p and q.
    for column, (by_p, by_q, by_h, by_m) in enumerate(
        ((-a, 0.0, zero, zero), (-b, -c, zero, zero), (x, 0.0, p, zero), (y, 0.0, zero, p),
         (0.0, y, zero, q))
    ):  # fmt: skip
        by_rho = (p * by_p + q * by_q) / rho
        by_norm = (h * (a * by_p + by_h) + m * (b * by_p + c * by_q + by_m)) / norm
        jacobian[:, column] = ((1.0 - 2.0 * rho) * by_rho - distance * by_norm) / norm
    return _step(distance, blur), distance


def _quarters(values: Array, offsets: Array, blur: float) -> tuple[Array, Array, Array]:
    """Cover by the black quarters, its derivatives by c, φ1, φ2, and minus that by ln s."""
    x, y = (offsets - values[CROSSING]).T
    sides, slopes, by_angle, normals = [], [], [], []
    for parameter in _EDGES:
        cos, sin = np.cos(values[parameter]), np.sin(values[parameter])
        distance = cos * y - sin * x
        step = _step(distance, blur)
        sides.append(2.0 * step.value - 1.0)
        slopes.append(2.0 * step.slope)
        by_angle.append(-(cos * x + sin * y))
        normals.append((-sin, cos, distance))
    # Inside the quarter between the directions φ1 and φ2, l1 > 0 and l2 < 0.
    cover = (1.0 - sides[0] * sides[1]) / 2
    by_first, by_second = -slopes[0] * sides[1] / 2, -sides[0] * slopes[1] / 2
    by_edges = np.stack(
        [
            -(by_first * normals[0][0] + by_second * normals[1][0]),
            -(by_first * normals[0][1] + by_second * normals[1][1]),
            by_first * by_angle[0],
            by_second * by_angle[1],
        ],
        axis=-1,
    )
    return cover, by_edges, by_first * normals[0][2] + by_second * normals[1][2]


def _step(distance: Array, blur: float) -> _Step:
    scaled = distance / (np.sqrt(2.0) * blur)
    slope = np.exp(-(scaled**2)) / (np.sqrt(2.0 * np.pi) * blur)
    return _Step((1.0 + erf(scaled)) / 2, slope)
