"""Where a piece of the line ends, to sub-pixel, along the line.

A flat Gaussian sheet of light on a surface with a straight edge, seen through a Gaussian blur,
gives a picture in closed form. With ``s`` along the line, ``t`` across it, the blur ``p``
(defocus and pixel), the seen line's standard deviation ``w``, the edge ``s = s0 + k t`` and
``q = 1 − p²/w²``::

    light = (a0 + a1 s) exp(−t²/2w²) Φ((s0 − s + k q t)/e),    e² = p² (1 + k² q)

which follows from convolving the product of Gaussian and step with the blur. The ambient light
on the surface is cut by the same edge: ``b1 Φ((s0 − s + k t) / (p √(1 + k²)))``. At ``t = 0`` the
line's light is half of what it would be without the edge, however oblique the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.imaging.stripe.gaussian import Centres
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.noise import noise_law

_CURVE_PX = 120.0
_BEND_WIDTHS = 3.0
_CURVE_DEGREES = (1, 2, 3)
_WORTH_A_DEGREE = 12.0  # drop of chi-squared; 1 in 2000 for a straight line by chance
_INSIDE_PX, _INSIDE_WIDTHS = 20.0, 5.0
_OUTSIDE_PX, _OUTSIDE_WIDTHS = 6.0, 2.0
_ACROSS_WIDTHS = 4.0
_BLUR_START_PX = 0.8
_LIKELY_SHEAR, _MOST_SHEAR = 2.0, 6.0
_OTHER_ALONG_PX = 2.5
_LEAST_SAMPLES = 40
_MOST_STEPS = 60
_CLEAR_STD_PX = 1.0
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
    blur : float
        Standard deviation of the fall of light along the line, px; NaN as `std`.
    direction : (2,) array
        Unit direction of the line at the end, outwards.
    """

    uv: Array
    std: float
    blur: float
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
    unseen = LineEnd(curve.point(rough), np.nan, np.nan, curve.direction(rough))
    if not _inside(light, curve, rough + 2.0 + width, 2.0 * width):
        return unseen
    window = _window(light, curve, rough, _depth(s_centres, rough, width), width, others)
    beside = np.abs(window.t) > 2.5 * width
    if not (beside & (window.s > 1.5)).any() or not (beside & (window.s < -1.5)).any():
        return unseen
    fit = _fitted(window, width, light.least_std)
    if fit is None:
        return unseen
    end, std, blur = fit
    return LineEnd(curve.point(rough + end), std, blur, curve.direction(rough + end))


def _depth(s_centres: Array, rough: float, width: float) -> float:
    """How far inwards the fall of light is looked at: not as far as the other end."""
    return min(_INSIDE_PX + _INSIDE_WIDTHS * width, 0.6 * (rough - float(s_centres[0])))


def bend_length(centres: Centres, width: float) -> float:
    """How far from the end a centre may feel it, px.

    The row or column of a centre lies oblique to the line by up to 45°, so its far samples reach
    past the end before its centre does; an oblique edge adds as much again.
    """
    du, dv = np.abs(centres.uv[-1] - centres.uv[0])
    oblique = min(du, dv) / max(du, dv)
    return 1.0 + _BEND_WIDTHS * width * (1.0 + float(oblique))


def _curve(centres: Centres, width: float) -> _Curve:
    """The centre line near the end, without the bend that an oblique edge gives it."""
    from_end = np.linalg.norm(centres.uv - centres.uv[-1], axis=1)
    from_start = np.linalg.norm(centres.uv - centres.uv[0], axis=1)
    bend = min(bend_length(centres, width), 0.3 * from_end[0])
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


def _profile(window: _Window, width: float) -> tuple[Array, Array]:
    """Height of the line's profile over its surroundings in steps of one pixel along it."""
    shape = np.exp(-0.5 * (window.t / width) ** 2)
    bins = np.floor(window.s).astype(int)
    positions, members = np.unique(bins, return_inverse=True)

    def total(values: Array) -> Array:
        return np.bincount(members, values)

    # Least squares of height and background, bin by bin.
    count, sum_x, sum_y = total(np.ones(len(shape))), total(shape), total(window.samples)
    spread = count * total(shape**2) - sum_x**2
    shared = count * total(shape * window.samples) - sum_x * sum_y
    full_bin = spread > 0.3 * np.median(spread)
    return shared[full_bin] / spread[full_bin], positions[full_bin].astype(float)


@dataclass(frozen=True)
class _Window:
    """Samples about an end: along and across the line, and their light."""

    s: Array
    t: Array
    samples: Array
    full: NDArray[np.bool_]


def _window(
    light: LineLight, curve: _Curve, rough: float, depth: float, width: float, others: Array
) -> _Window:
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
    return _Window(s[use], t[use], light.picture[at].astype(float), light.full[at])


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


def _fitted(window: _Window, width: float, least_std: float) -> tuple[float, float, float] | None:
    """Position, standard uncertainty and blur of the end; None where there is no clear edge."""
    if len(window.s) < _LEAST_SAMPLES:
        return None
    fit = _least_squares(window, _start(window, width), np.ones(len(window.s)), width)
    lit = _light(fit.x, window.s, window.t)[0] - fit.x[6]
    freedom = 1.0 - len(fit.x) / len(window.s)
    law = noise_law(fit.fun[:-1], lit, freedom, least_std)
    fit = _least_squares(window, fit.x, 1.0 / law.std(lit), width)
    end, blur = float(fit.x[3]), float(fit.x[5])
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac, hermitian=True)
    std = float(np.sqrt(covariance[3, 3]))
    at_limit = max(abs(end), blur) > 0.99 * _farthest_end(width)
    clear = fit.success and fit.x[0] > 0 and not at_limit and std < _CLEAR_STD_PX
    return (end, std, blur) if clear else None


def _least_squares(
    window: _Window, start: Array, weights: Array, width: float
) -> OptimizeResult:
    """Bounded least squares; the last residual keeps the edge from lying along the line."""

    def residuals(parameters: Array) -> Array:
        misfit = _light(parameters, window.s, window.t)[0] - window.samples
        # A full sample says only that the light was at least as bright.
        misfit = np.where(window.full, np.minimum(misfit, 0.0), misfit)
        return np.append(weights * misfit, parameters[4] / _LIKELY_SHEAR)

    def jacobian(parameters: Array) -> Array:
        model, derivatives = _light(parameters, window.s, window.t)
        free = weights * ~(window.full & (model > window.samples))
        shear = np.zeros((1, len(parameters)))
        shear[0, 4] = 1.0 / _LIKELY_SHEAR
        return np.concatenate([free[:, None] * derivatives, shear])

    far = _farthest_end(width)
    low = np.array([0.0, -np.inf, 0.3 * width, -far, -_MOST_SHEAR, 0.1, *3 * [-np.inf]])
    high = np.array([np.inf, np.inf, 3.0 * width, far, _MOST_SHEAR, far, *3 * [np.inf]])
    return least_squares(
        residuals,
        np.clip(start, low + 1e-3, high - 1e-3),
        jac=jacobian,
        bounds=(low, high),
        x_scale="jac",
        max_nfev=_MOST_STEPS,
    )


def _farthest_end(width: float) -> float:
    """Limit of what the fit may find, both of the end's distance and of its blur, px."""
    return 3.0 + width


def _start(window: _Window, width: float) -> Array:
    """Rough parameters of `_light`."""
    beside, core = np.abs(window.t) > 2.5 * width, np.abs(window.t) < 0.5 * width + 0.5
    level = float(np.median(window.samples[beside & (window.s > 1.5)]))
    ambient = float(np.median(window.samples[beside & (window.s < -1.5)]))
    bright = float(np.median(window.samples[core & (window.s < -1.5)]))
    return np.array(
        [bright - ambient, 0.0, width, 0.0, 0.0, _BLUR_START_PX, level, 0.0, ambient - level]
    )


def _light(parameters: Array, s: Array, t: Array) -> tuple[Array, Array]:
    """The closed form of the module's docstring, and its derivatives ``(N, 9)``."""
    a0, a1, w, s0, k, p, b0, b_across, b1 = parameters
    q = max(1.0 - (p / w) ** 2, 0.0)
    shape = np.exp(-0.5 * (t / w) ** 2)
    ridge = (a0 + a1 * s) * shape

    e = p * np.sqrt(1.0 + k * k * q)
    x = (s0 - s + k * q * t) / e
    cut, density = ndtr(x), _density(x)
    cut_by_k = density * (q * t - x * p * p * k * q / e) / e
    cut_by_q = density * (k * t - x * p * p * k * k / (2.0 * e)) / e
    q_by_p, q_by_w = (-2.0 * p / w**2, 2.0 * p * p / w**3) if q > 0 else (0.0, 0.0)

    m = p * np.sqrt(1.0 + k * k)
    y = (s0 - s + k * t) / m
    edge, edge_density = ndtr(y), _density(y)
    edge_by_k = edge_density * (t / m - y * k / (1.0 + k * k))

    derivatives = np.stack(
        [
            shape * cut,
            s * shape * cut,
            ridge * (cut * t * t / w**3 + cut_by_q * q_by_w),
            ridge * density / e + b1 * edge_density / m,
            ridge * cut_by_k + b1 * edge_by_k,
            ridge * (cut_by_q * q_by_p - density * x / p) - b1 * edge_density * y / p,
            np.ones_like(s),
            t,
            edge,
        ],
        axis=-1,
    )
    return ridge * cut + b0 + b_across * t + b1 * edge, derivatives


def _density(x: Array) -> Array:
    return np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
