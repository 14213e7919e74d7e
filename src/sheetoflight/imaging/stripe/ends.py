"""Where a piece of the line ends: the picture around its last centres, and the edge in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.imaging.stripe.centres import Centres
from sheetoflight.imaging.stripe.edge import Window, fitted_edge
from sheetoflight.imaging.stripe.light import LineLight

_CURVE_PX = 120.0
_BEND_WIDTHS = 3.0
_REACH_BLURS, _REACH_WIDTHS = 2.0, 2.5
_CURVE_DEGREES = (1, 2, 3)
_WORTH_A_DEGREE = 12.0  # drop of chi-squared; 1 in 2000 for a straight line by chance
_INSIDE_PX, _INSIDE_WIDTHS = 20.0, 5.0
_OUTSIDE_PX, _OUTSIDE_WIDTHS = 6.0, 2.0
_ACROSS_WIDTHS = 4.0
_OTHER_ALONG_PX = 2.5
_WIDTH_ROWS = 60
_PIXEL_STD = float(np.sqrt(1.0 / 12.0))


@dataclass(frozen=True)
class LineEnd:
    """One end of a piece.

    Parameters
    ----------
    uv : (2,) array
        Where the line's centre meets the edge, px.
    std : float
        Standard uncertainty along the line, px; NaN where the edge is not in the picture.
    reach : float
        How far inwards from the end the fall of light may move a row's or column's centre, px.
    direction : (2,) array
        Unit direction of the line at the end, outwards.
    """

    uv: Array
    std: float
    reach: float
    direction: Array

    @property
    def seen(self) -> bool:
        """Whether the edge itself is in the picture."""
        return bool(np.isfinite(self.std))


@dataclass(frozen=True)
class _Curve:
    """The centre line near an end: ``t = polynomial(s)`` in a frame along its chord."""

    origin: Array
    along: Array
    polynomial: np.polynomial.Polynomial

    @property
    def across(self) -> Array:
        return np.array([-self.along[1], self.along[0]])

    def frame(self, uv: Array) -> tuple[Array, Array]:
        """``s`` and the distance ``t`` from the curve of points ``(..., 2)``."""
        offset = uv - self.origin
        s = offset @ self.along
        tilt = np.sqrt(1.0 + self.polynomial.deriv()(s) ** 2)
        return s, (offset @ self.across - self.polynomial(s)) / tilt

    def point(self, s: float) -> Array:
        return self.origin + s * self.along + self.polynomial(s) * self.across

    def direction(self, s: float) -> Array:
        direction = self.along + float(self.polynomial.deriv()(s)) * self.across
        return direction / np.linalg.norm(direction)


def line_ends(
    light: LineLight, centres: Centres, others: Array
) -> tuple[LineEnd, LineEnd, NDArray[np.bool_]]:
    """Both ends of a piece, and which of its centres ``(N,)`` neither of them touches.

    The fall of light at an oblique end moves the centres of the rows or columns that it crosses:
    the bend at both ends of the paper's Fig. 8.
    """
    last = line_end(light, centres, others)
    first = line_end(light, centres.taken(slice(None, None, -1)), others)
    return first, last, _clear_of(first, centres.uv[::-1])[::-1] & _clear_of(last, centres.uv)


def _clear_of(end: LineEnd, uv: Array) -> NDArray[np.bool_]:
    """Centres ``(N, 2)``, in order towards the end, whose rows or columns the fall of light there
    does not touch; distances are counted along the line, which may turn. An end that is not seen
    touches none."""
    if not end.seen:
        return np.ones(len(uv), dtype=bool)
    steps = np.linalg.norm(np.diff(uv[::-1], axis=0), axis=1)
    from_last = np.concatenate([[0.0], np.cumsum(steps)])[::-1]
    return from_last + (end.uv - uv[-1]) @ end.direction >= end.reach


def line_end(light: LineLight, centres: Centres, others: Array) -> LineEnd:
    """The end at the last of the centres.

    Parameters
    ----------
    light : LineLight
    centres : Centres
        Of one unbroken piece, in order towards the end of interest.
    others : (M, 2) array
        Centres of other pieces, px, whose light is left out.
    """
    width = float(np.median(np.hypot(centres.width[-_WIDTH_ROWS:], _PIXEL_STD)))
    curve = _curve(centres, width)
    s_centres, _ = curve.frame(centres.uv)
    rough = _half_height(light, curve, s_centres, width, others)
    unseen = LineEnd(curve.point(rough), np.nan, 0.0, curve.direction(rough))
    if not _inside(light, curve, rough + 2.0 + width, 2.0 * width):
        return unseen
    window = _window(light, curve, rough, _depth(s_centres, rough, width), width, others)
    edge = fitted_edge(window, width, light.least_std)
    if edge is None:
        return unseen
    end = rough + edge.s
    direction = curve.direction(end)
    oblique = _obliqueness(direction) + abs(edge.shear)
    reach = _REACH_BLURS * edge.blur + _REACH_WIDTHS * width * oblique
    return LineEnd(curve.point(end), edge.std, reach, direction)


def _depth(s_centres: Array, rough: float, width: float) -> float:
    """How far inwards the fall of light is looked at: not as far as the other end."""
    return min(_INSIDE_PX + _INSIDE_WIDTHS * width, 0.6 * (rough - float(s_centres[0])))


def _obliqueness(direction: Array) -> float:
    """How far along the line a row or column reaches for each px across it: 0 to 1."""
    lengths = np.abs(direction)
    return float(lengths.min() / lengths.max())


def _curve(centres: Centres, width: float) -> _Curve:
    """The centre line near the end, without the bend that an oblique edge gives it."""
    from_end = np.linalg.norm(centres.uv - centres.uv[-1], axis=1)
    from_start = np.linalg.norm(centres.uv - centres.uv[0], axis=1)
    oblique = 1.0 + _obliqueness(centres.uv[-1] - centres.uv[0])
    bend = min(1.0 + _BEND_WIDTHS * width * oblique, 0.3 * from_end[0])
    near = (from_end <= _CURVE_PX) & (from_end >= bend) & (from_start >= bend)
    uv, std = centres.uv[near], centres.std[near]
    origin, along = fitted_line(uv)
    offset = uv - origin
    across = np.array([-along[1], along[0]])
    s, t = offset @ along, offset @ across
    return _Curve(origin, along, _lowest_polynomial(s, t, std))


def _lowest_polynomial(s: Array, t: Array, std: Array) -> np.polynomial.Polynomial:
    """The polynomial of lowest degree that the centres do not contradict, outliers left out."""
    chosen, chosen_misfit = None, np.inf
    keep = np.ones(len(s), dtype=bool)
    for degree in _CURVE_DEGREES:
        if keep.sum() < degree + 3:
            break
        fit, keep = _robust_polynomial(s, t, std, degree)
        residual = (t - fit(s)) / std
        scale = max(1.0, 1.4826 * float(np.median(np.abs(residual))))
        misfit = float(np.sum(np.minimum(np.abs(residual / scale), 4.0) ** 2))
        if chosen is None or misfit < chosen_misfit - _WORTH_A_DEGREE:
            chosen, chosen_misfit = fit, misfit
    if chosen is None:
        return np.polynomial.Polynomial([float(np.mean(t))])
    return chosen


def _robust_polynomial(
    s: Array, t: Array, std: Array, degree: int
) -> tuple[np.polynomial.Polynomial, NDArray[np.bool_]]:
    keep = np.ones(len(s), dtype=bool)
    fit = np.polynomial.Polynomial.fit(s, t, degree, w=1.0 / std)
    for _ in range(3):
        residual = (t - fit(s)) / std
        limit = 3.5 * max(1.0, 1.4826 * float(np.median(np.abs(residual))))
        keep = np.abs(residual) <= limit
        fit = np.polynomial.Polynomial.fit(s[keep], t[keep], degree, w=1.0 / std[keep])
    return fit, keep


def _inside(light: LineLight, curve: _Curve, s: float, margin: float) -> bool:
    """Whether the line's light at `s`, a margin on either side, lies in the picture."""
    height, width = light.picture.shape
    corners = curve.point(s) + margin * np.array([[-1.0], [1.0]]) * curve.across
    limits = np.array([width - 1.0, height - 1.0])
    return bool(((corners >= 0.0) & (corners <= limits)).all())


def _half_height(
    light: LineLight, curve: _Curve, s_centres: Array, width: float, others: Array
) -> float:
    """Where along the curve the line's light has fallen to half of its plateau, to a pixel or so.

    The last centres are no guide: near the end their rows or columns may reach past it.
    """
    last = float(s_centres[-1])
    window = _window(light, curve, last, _depth(s_centres, last, width), width, others)
    profile, positions = _profile(window, width)
    lit = profile > 0.5 * float(np.median(profile[: max(3, len(profile) // 2)]))
    dark = np.flatnonzero(~(lit | np.append(lit[1:], lit[-1])))
    return last + float(positions[dark[0]] if len(dark) else positions[-1])


def _profile(window: Window, width: float) -> tuple[Array, Array]:
    """Height of the line's profile over its surroundings in steps of one pixel along it."""
    shape = np.exp(-0.5 * (window.t / width) ** 2)
    bins = np.floor(window.s).astype(int)
    positions, members = np.unique(bins, return_inverse=True)

    def total(values: Array) -> Array:
        return np.bincount(members, values).astype(float)

    # Least squares of height and background, bin by bin.
    count, sum_x, sum_y = total(np.ones(len(shape))), total(shape), total(window.samples)
    spread = count * total(shape**2) - sum_x**2
    shared = count * total(shape * window.samples) - sum_x * sum_y
    full_bin = spread > 0.3 * np.median(spread)
    return shared[full_bin] / spread[full_bin], positions[full_bin].astype(float)


def _window(
    light: LineLight, curve: _Curve, rough: float, depth: float, width: float, others: Array
) -> Window:
    """The pixels from `depth` inside to some pixels outside, without those of other pieces."""
    beyond = _OUTSIDE_PX + _OUTSIDE_WIDTHS * width
    reach = 1.0 + _ACROSS_WIDTHS * width
    centre, radius = curve.point(rough + (beyond - depth) / 2), (beyond + depth) / 2 + reach
    rows, columns = _square(light.picture.shape, centre, radius)
    s, t = curve.frame(np.stack([columns, rows], axis=-1).astype(float))
    s = s - rough
    use = (s > -depth) & (s < beyond) & (np.abs(t) < reach)
    use[use] &= ~_belongs_to_others(s[use] + rough, t[use], curve, others, width)
    at = (rows[use], columns[use])
    return Window(s[use], t[use], light.picture[at].astype(float), light.full[at])


def _square(
    shape: tuple[int, ...], centre: Array, radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the picture's pixels in a square."""
    left, top = np.maximum(np.floor(centre - radius).astype(int), 0)
    right, bottom = np.ceil(centre + radius).astype(int)
    rows, columns = np.meshgrid(
        np.arange(top, min(bottom, shape[0] - 1) + 1),
        np.arange(left, min(right, shape[1] - 1) + 1),
        indexing="ij",
    )
    return rows.ravel(), columns.ravel()


def _belongs_to_others(
    s: Array, t: Array, curve: _Curve, others: Array, width: float
) -> NDArray[np.bool_]:
    """Mask of the samples that show light of other pieces."""
    lies = np.zeros(len(s), dtype=bool)
    if len(s) == 0 or len(others) == 0:
        return lies
    other_s, other_t = curve.frame(others)
    near = (other_s > s.min() - 5.0) & (other_s < s.max() + 5.0)
    near &= np.abs(other_t) < np.abs(t).max() + 5.0 * width
    for along, across in zip(other_s[near], other_t[near], strict=True):
        lies |= (np.abs(s - along) < _OTHER_ALONG_PX) & (np.abs(t - across) < 3.5 * width)
    return lies
