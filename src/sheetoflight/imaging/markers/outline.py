"""The picture of one marker as a formula, with its derivatives.

A disc of ink on lighter (or darker) ground, evenly sloping light, smoothed edges; and the
laser line, if it crosses the marker, as further light that ink and ground reflect alike::

    I(x) = (w0 + w·(x − x0) + A exp(−t²/2b²)) (1 − k Q(x) D(x)),  t = m·(x − x0) − t0
    D = Φ(d/s),  d = signed distance to the outline |L (x − e)| = 1, positive inside
    Q = (1 + erf(l1/√2 s) erf(l2/√2 s)) / 2,  li = n(φi)·(x − c)     quadrant marker
    Q = 1                                                            disc

The outline has a centre ``e`` of its own: under perspective the middle of the ellipse is not the
image of the disc's centre, whereas the crossing ``c`` of the two edges is.
"""

from __future__ import annotations

from dataclasses import dataclass
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
_EDGE_PARAMETERS = slice(10, 14)
_DISC_PARAMETERS, _QUADRANT_PARAMETERS = 10, 14
_LINE_PARAMETERS = 3
_NARROWEST_PX, _WIDEST_PX = 0.1, 300.0


@dataclass(frozen=True)
class LineLight:
    """A straight stripe of light across a marker, as a start for the fit.

    Parameters
    ----------
    normal : (2,) array
        Unit normal m of the stripe, which stays as it is.
    offset : float
        t0: the middle's distance from x0 along the normal, px.
    amplitude : float
        A: grey values that it adds to the ground.
    width : float
        b: its standard deviation, px.
    """

    normal: Array
    offset: float
    amplitude: float
    width: float


class _Step(NamedTuple):
    """A smoothed step (0 to 1) of a signed distance, and its slope."""

    value: Array
    slope: Array


def starting_parameters(
    candidate: Candidate, quadrant: bool, blur: float, line: LineLight | None = None
) -> Array:
    """Parameters of the formula for a candidate; its centre is ``x0`` and the origin."""
    values = np.zeros(_QUADRANT_PARAMETERS if quadrant else _DISC_PARAMETERS)
    inverse = np.linalg.inv(candidate.frame)
    form = np.linalg.qr(inverse).R
    values[_FORM] = form[0, 0], form[0, 1], form[1, 1]
    values[_BLUR] = np.log(blur)
    values[_WHITE] = candidate.surround
    values[_INK] = candidate.contrast / candidate.surround
    if quadrant:
        values[_EDGES[0]] = np.arctan2(candidate.frame[1, 0], candidate.frame[0, 0])
        values[_EDGES[1]] = np.arctan2(candidate.frame[1, 1], candidate.frame[0, 1])
    if line is None:
        return values
    return np.concatenate([values, [line.amplitude, line.offset, np.log(line.width)]])


def frame_of(values: Array) -> Array:
    """The outline's and edges' `Candidate.frame`."""
    form = np.zeros((2, 2))
    form[0, 0], form[0, 1], form[1, 1] = values[_FORM]
    if not _is_quadrant(values):
        return np.linalg.inv(form)
    unit = np.array([np.cos(values[list(_EDGES)]), np.sin(values[list(_EDGES)])])
    return unit / np.linalg.norm(form @ unit, axis=0)


def contrast_of(values: Array) -> tuple[float, float]:
    """Surround less ink, and the surround, at the marker's centre."""
    return float(values[_WHITE] * values[_INK]), float(values[_WHITE])


def bounded(values: Array) -> Array:
    """The parameters with their widths held to what a picture can show."""
    inside = values.copy()
    widths = [_BLUR] if len(values) in (_DISC_PARAMETERS, _QUADRANT_PARAMETERS) else [_BLUR, -1]
    inside[widths] = np.clip(inside[widths], np.log(_NARROWEST_PX), np.log(_WIDEST_PX))
    return inside


def intensity(
    values: Array, offsets: Array, line: LineLight | None = None
) -> tuple[Array, Array, Array]:
    """The formula at offsets ``(N, 2)`` px from x0.

    Returns
    -------
    grey : (N,)
    jacobian : (N, P)
    line_grey : (N,)
        The laser line's part of `grey`.
    """
    jacobian = np.zeros((len(offsets), len(values)))
    blur = np.exp(values[_BLUR])
    line_light = _line_light(values, offsets, line, jacobian)
    light = values[_WHITE] + offsets @ values[_SLOPE] + line_light
    disc, distance = _disc(values, offsets, blur, jacobian)
    ink = values[_INK]
    by_disc = -light * ink * disc.slope
    by_blur = -by_disc * distance
    cover = disc.value
    if _is_quadrant(values):
        quarters, by_edges, edge_blur = _quarters(values, offsets, blur)
        cover = cover * quarters
        by_blur = by_blur * quarters + light * ink * disc.value * edge_blur
        by_disc = by_disc * quarters
        jacobian[:, _EDGE_PARAMETERS] = (-light * ink * disc.value)[:, None] * by_edges
    jacobian[:, :_BLUR] *= by_disc[:, None]
    jacobian[:, _BLUR] = by_blur
    shade = 1.0 - ink * cover
    jacobian[:, _WHITE] = shade
    jacobian[:, _SLOPE] = shade[:, None] * offsets
    jacobian[:, _INK] = -light * cover
    if line is not None:
        jacobian[:, -_LINE_PARAMETERS:] *= shade[:, None]
    return light * shade, jacobian, line_light * shade


def _is_quadrant(values: Array) -> bool:
    return len(values) >= _QUADRANT_PARAMETERS


def _line_light(values: Array, offsets: Array, line: LineLight | None, jacobian: Array) -> Array:
    """The stripe's light on the ground; writes its derivatives into the Jacobian."""
    if line is None:
        return np.zeros(len(offsets))
    amplitude, offset, log_width = values[-_LINE_PARAMETERS:]
    ratio = (offsets @ line.normal - offset) * np.exp(-log_width)
    profile = np.exp(-0.5 * ratio**2)
    light = amplitude * profile
    jacobian[:, -3] = profile
    jacobian[:, -2] = light * ratio * np.exp(-log_width)
    jacobian[:, -1] = light * ratio**2
    return light


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
