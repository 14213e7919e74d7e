"""The edge of a lit surface across the laser line: model and fit.

A flat Gaussian sheet of light on a surface with a straight edge, seen through a Gaussian blur,
gives a picture in closed form. With ``s`` along the line, ``t`` across it, the blur ``p``
(defocus and pixel), the seen line's standard deviation ``w``, the edge ``s = s0 + k t`` and
``q = 1 − p²/w²``::

    light = (a0 + a1 s) exp(−t²/2w²) Φ((s0 − s + k q t)/e),    e² = p² (1 + k² q)

which follows from convolving the product of Gaussian and step with the blur. The ambient light
on the surface is cut by the same edge: ``b0 + b_t t + b1 Φ((s0 − s + k t) / (p √(1 + k²)))``. At
``t = 0`` the line's light is half of what it would be without the edge, however oblique the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.noise import noise_law, redundancies

_BLUR_START_PX = 0.8
_LIKELY_SHEAR, _MOST_SHEAR = 2.0, 6.0
_LEAST_SAMPLES = 40
_MOST_STEPS = 40
_CONVERGED_PX = 1e-4
_CONVERGED_COST = 1e-6
_CLEAR_STD_PX = 1.0


@dataclass(frozen=True)
class Window:
    """Samples about an end.

    Parameters
    ----------
    s, t : (N,) arrays
        Where they lie along and across the line, px; `s` grows outwards from a rough end.
    samples : (N,) array
        Their light, grey levels.
    full : (N,) bool array
        Whether the sensor was full there.
    """

    s: Array
    t: Array
    samples: Array
    full: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.s)


@dataclass(frozen=True)
class Edge:
    """Where the light falls along the line.

    Parameters
    ----------
    s : float
        Where the line's centre meets the edge, px from the rough end.
    std : float
        Its standard uncertainty, px.
    blur : float
        Standard deviation of the fall of light, px.
    shear : float
        How far the edge runs along the line for each px across it.
    """

    s: float
    std: float
    blur: float
    shear: float


def fitted_edge(window: Window, width: float, least_std: float) -> Edge | None:
    """Fit the edge; None where the light shows no clear one.

    Parameters
    ----------
    window : Window
    width : float
        Rough standard deviation of the line's profile, px.
    least_std : float
        What rounding to whole grey levels alone gives, grey levels.
    """
    start = _start(window, width)
    if start is None:
        return None
    far = 3.0 + width
    low = np.array([0.0, -np.inf, 0.3 * width, -far, -_MOST_SHEAR, 0.1, *3 * [-np.inf]])
    high = np.array([np.inf, np.inf, 3.0 * width, far, _MOST_SHEAR, far, *3 * [np.inf]])
    rough, known, _ = _least_squares(window, start, np.ones(len(window)), low, high)
    model, derivatives = light_at(rough, window.s, window.t)
    lit = rough[0] * derivatives[:, 0]
    used = ~(window.full & (model > window.samples))
    law = noise_law(
        (window.samples - model)[used],
        lit[used],
        redundancies(derivatives[used], known),
        least_std,
    )
    fit, information, still = _least_squares(window, rough, 1.0 / law.std(lit), low, high)
    std = float(np.sqrt(np.linalg.pinv(information, hermitian=True)[3, 3]))
    at_limit = max(abs(fit[3]), fit[5]) > 0.99 * far
    clear = still and fit[0] > 0 and not at_limit and std < _CLEAR_STD_PX
    return Edge(float(fit[3]), std, float(fit[5]), float(fit[4])) if clear else None


def _least_squares(
    window: Window, start: Array, weights: Array, low: Array, high: Array
) -> tuple[Array, Array, bool]:
    """Levenberg–Marquardt within bounds.

    Returns
    -------
    parameters : (9,), information : (9, 9), still : bool
        Whether the last step was short.
    """
    parameters = np.clip(start, low + 1e-3, high - 1e-3)
    cost, gradient, information = _normal_equations(window, parameters, weights)
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        damped = information + damping * np.diag(np.diag(information)) + 1e-12 * np.eye(9)
        trial = np.clip(parameters + np.linalg.solve(damped, gradient), low, high)
        shift = abs(trial[3] - parameters[3])
        found = _normal_equations(window, trial, weights)
        gain = cost - found[0]
        if gain >= 0:
            parameters, (cost, gradient, information) = trial, found
        damping = max(damping * (0.2 if gain >= 0 else 10.0), 1e-9)
        if shift < _CONVERGED_PX and abs(gain) < _CONVERGED_COST * (1.0 + cost):
            return parameters, information, True
    return parameters, information, False


def _normal_equations(
    window: Window, parameters: Array, weights: Array
) -> tuple[float, Array, Array]:
    """Sum of squares, downhill gradient and information matrix."""
    model, derivatives = light_at(parameters, window.s, window.t)
    # A full sample says only that the light was at least as bright.
    weights = weights * ~(window.full & (model > window.samples))
    residuals = weights * (window.samples - model)
    jacobian = weights[:, None] * derivatives
    gradient, information = jacobian.T @ residuals, jacobian.T @ jacobian
    # What is known beforehand keeps the edge from lying along the line.
    information[4, 4] += _LIKELY_SHEAR**-2
    gradient[4] -= parameters[4] * _LIKELY_SHEAR**-2
    cost = float(residuals @ residuals) + (parameters[4] / _LIKELY_SHEAR) ** 2
    return cost, gradient, information


def _start(window: Window, width: float) -> Array | None:
    """Rough parameters of `light_at`; None where the window does not show inside and outside."""
    beside, core = np.abs(window.t) > 2.5 * width, np.abs(window.t) < 0.5 * width + 0.5
    inside, outside = window.s < -1.5, window.s > 1.5
    parts = [window.samples[part] for part in (beside & outside, beside & inside, core & inside)]
    if len(window) < _LEAST_SAMPLES or not all(len(part) for part in parts):
        return None
    level, ambient, bright = (float(np.median(part)) for part in parts)
    step = ambient - level
    return np.array([bright - ambient, 0.0, width, 0.0, 0.0, _BLUR_START_PX, level, 0.0, step])


def light_at(parameters: Array, s: Array, t: Array) -> tuple[Array, Array]:
    """The closed form of the module's docstring, and its derivatives ``(N, 9)``.

    Parameters
    ----------
    parameters : (9,) array
        ``a0, a1, w, s0, k, p, b0, b_t, b1``.
    s, t : (N,) arrays
        Along and across the line, px.
    """
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
