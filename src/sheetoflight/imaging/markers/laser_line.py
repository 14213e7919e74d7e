"""The laser line along the target, as the plain strip between the markers shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.outline import LineLight
from sheetoflight.imaging.markers.strip import StripProfiles


@dataclass(frozen=True)
class LineOptions:
    """What light along the strip is the laser's.

    Parameters
    ----------
    least_excess : float
        Light above the strip's own brightness, as a share of it.
    least_excess_in_noise : float
        The same in standard deviations of a section's median.
    saturated : float
        Grey value at which the sensor tells no more.
    """

    least_excess: float = 0.02
    least_excess_in_noise: float = 4.0
    saturated: float = 250.0


_LEAST_SECTIONS = 4
_LEAST_SAMPLES = 6
_OUTER_SHARE = 0.75
_WHITE, _BRIGHTEST, _WIDEST_PX = 255.0, 40.0, 50.0
# Standard deviation of the median of n normal values, times √n.
_MEDIAN_SPREAD = 1.2533


def laser_along(
    strip: StripProfiles, markers: Array, noise: float, options: LineOptions = LineOptions()
) -> list[LineLight | None]:
    """For each marker the laser line that crosses it along the target, if there is one.

    The strip between the markers is plain, so a bright ridge there that runs along the target
    is the line; its course over the markers follows from a parabola through it.

    Parameters
    ----------
    strip : StripProfiles
    markers : (M, 2) array
        Image points of the markers, px: the origins of the offsets returned.
    noise : float
        Standard deviation of a pixel's random error.
    """
    nowhere: list[LineLight | None] = [None] * len(markers)
    if len(strip.places) < _LEAST_SECTIONS:
        return nowhere
    unlit = _unlit(strip)
    excess = strip.grey - unlit
    spread = _MEDIAN_SPREAD * noise / np.sqrt(float(np.median(strip.averaged)))
    least = max(
        options.least_excess * float(np.median(unlit)), options.least_excess_in_noise * spread
    )
    lit = excess.max(axis=1) > 2 * least
    if lit.mean() < 0.5:
        return nowhere
    course = _course(strip, excess, lit)
    away = strip.across[None, :] - course(strip.places[lit])[:, None]
    telling = (excess[lit] > least) & (strip.grey[lit] < options.saturated)
    amplitude, width = _gaussian(away[telling], excess[lit][telling])
    lines: list[LineLight | None] = []
    for marker in markers:
        a = float((marker - strip.centre) @ strip.along)
        slope = float(course.deriv()(a))
        normal = (strip.normal - slope * strip.along) / np.hypot(1.0, slope)
        middle = strip.centre + a * strip.along + float(course(a)) * strip.normal
        lines.append(LineLight(normal, float((middle - marker) @ normal), amplitude, width))
    return lines


def _gaussian(away: Array, excess: Array) -> tuple[float, float]:
    """Amplitude and standard deviation of a Gaussian, from a line through ln e over n²."""
    if len(away) < _LEAST_SAMPLES:
        return _WHITE, 1.0
    design = np.stack([np.ones_like(away), -0.5 * away**2], axis=-1)
    # ln e has the standard deviation of e over e.
    (log_amplitude, curvature), *_ = np.linalg.lstsq(
        design * excess[:, None], np.log(excess) * excess, rcond=None
    )
    width = 1.0 / np.sqrt(np.clip(curvature, 1.0 / _WIDEST_PX**2, 4.0))
    return float(np.exp(min(log_amplitude, np.log(_BRIGHTEST * _WHITE)))), float(width)


def _unlit(strip: StripProfiles) -> Array:
    """The strip's own brightness under each profile: a line through its outer parts."""
    outer = _OUTER_SHARE * strip.across[-1]
    low = np.median(strip.grey[:, strip.across < -outer], axis=1)[:, None]
    high = np.median(strip.grey[:, strip.across > outer], axis=1)[:, None]
    middle = (1 + _OUTER_SHARE) / 2 * strip.across[-1]
    return (low + high) / 2 + (high - low) * strip.across / (2 * middle)


def _course(strip: StripProfiles, excess: Array, lit: np.ndarray) -> np.polynomial.Polynomial:
    """Place of the line across the target as a parabola of the place along it, px."""
    core = np.maximum(excess - 0.5 * excess.max(axis=1, keepdims=True), 0.0)[lit]
    middle = (core * strip.across).sum(axis=1) / core.sum(axis=1)
    return np.polynomial.Polynomial.fit(strip.places[lit], middle, min(2, int(lit.sum()) - 1))
