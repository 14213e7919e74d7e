"""The laser line along the target: where its light hides the markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.strip import StripProfiles


@dataclass(frozen=True)
class LaserBand:
    """A straight band of the picture, about one marker.

    Parameters
    ----------
    point, normal : (2,) array
        A point of the band's middle line in px, and the unit normal of that line.
    half_width : float
        Half the band's width, px.
    """

    point: Array
    normal: Array
    half_width: float

    def covers(self, uv: Array) -> np.ndarray:
        """Mask ``(N,)`` of the image points ``(N, 2)`` inside the band."""
        return np.abs((uv - self.point) @ self.normal) < self.half_width


@dataclass(frozen=True)
class BandOptions:
    """What light along the strip is the laser's.

    Parameters
    ----------
    least_excess : float
        Light above the strip's own brightness, as a share of it.
    least_excess_in_noise : float
        The same in standard deviations of a section's median.
    margin_px : float
        Room added at both sides.
    """

    least_excess: float = 0.02
    least_excess_in_noise: float = 4.0
    margin_px: float = 1.0


_LEAST_SECTIONS = 4
_OUTER_SHARE = 0.75
# Standard deviation of the median of n normal values, times √n.
_MEDIAN_SPREAD = 1.2533


def laser_bands(
    strip: StripProfiles, markers: Array, noise: float, options: BandOptions = BandOptions()
) -> list[LaserBand | None]:
    """For each marker the band in which the laser line crosses it along the target, if it does.

    The strip between the markers is plain, so a bright ridge there that runs along the target
    is the line; its course over the markers follows from a parabola through it.

    Parameters
    ----------
    strip : StripProfiles
    markers : (M, 2) array
        Image points of the markers, px.
    noise : float
        Standard deviation of a pixel's random error.
    """
    nowhere: list[LaserBand | None] = [None] * len(markers)
    if len(strip.places) < _LEAST_SECTIONS:
        return nowhere
    unlit = _unlit(strip)
    excess = strip.grey - unlit
    spread = _MEDIAN_SPREAD * noise / np.sqrt(float(np.median(strip.averaged)))
    least = max(
        options.least_excess * float(np.median(unlit)),
        options.least_excess_in_noise * spread,
    )
    lit = excess.max(axis=1) > 2 * least
    if lit.mean() < 0.5:
        return nowhere
    course = _course(strip, excess, lit)
    half_width = _half_width(strip, excess[lit], course(strip.places[lit]), least)
    half_width += options.margin_px
    bands: list[LaserBand | None] = []
    for a in (markers - strip.centre) @ strip.along:
        slope = float(course.deriv()(a))
        point = strip.centre + a * strip.along + float(course(a)) * strip.normal
        normal = (strip.normal - slope * strip.along) / np.hypot(1.0, slope)
        bands.append(LaserBand(point, normal, half_width))
    return bands


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


def _half_width(strip: StripProfiles, excess: Array, middle: Array, least: float) -> float:
    """Distance from the line's middle beyond which its light is below ``least``."""
    away = np.abs(strip.across[None, :] - middle[:, None])
    steps = np.arange(0.0, float(strip.across[-1]), 0.5)
    for distance in steps:
        beyond = (away >= distance) & (away < distance + 1.5)
        if beyond.any() and np.median(excess[beyond]) < least:
            return float(distance) + 0.5
    return float(strip.across[-1])
