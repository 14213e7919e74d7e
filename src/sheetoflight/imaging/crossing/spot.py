"""The spot where the sheet of light crosses the target, in one picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.crossing import refusals
from sheetoflight.imaging.crossing.axis import TargetAxis
from sheetoflight.imaging.crossing.fit import StraightLine, fitted_line_of_light
from sheetoflight.imaging.crossing.outcome import (
    NoSpotError,
    SpotOptions,
    SpotSearch,
    SpotSighting,
)
from sheetoflight.imaging.crossing.search import RoughLine, brightest_line
from sheetoflight.imaging.crossing.strip import Strip, strip_seen
from sheetoflight.imaging.markers.sighting import TargetSighting, listed
from sheetoflight.model.target import CollinearTarget

_FITTED_WIDTHS, _FITTED_PX = 4.0, 3.0
_LIT_WIDTHS = 6.0
_FEWEST_PIXELS = 24


def find_spot(
    picture: NDArray[Any],
    target: CollinearTarget,
    sighting: TargetSighting,
    picture_off: NDArray[Any] | None = None,
    options: SpotOptions | None = None,
) -> SpotSearch:
    """Find the point where the laser's line crosses the axis of a sighted target.

    The line is measured where it lies on the strip's plain paper, and intersected with the axis,
    the curve through the markers' centres. One picture shows one laser: the order of several
    spots along the target does not tell whose they are. On the short strip the line counts as
    straight: a lens that bends the target's axis by 2 px bends the line there by about 0.01 px.

    Parameters
    ----------
    picture : (H, W) or (H, W, 3) array
        Laser on; uint8, uint16 or floating point; colour in OpenCV's order BGR.
    target : CollinearTarget
    sighting : TargetSighting
        Where the target is; from `picture_off` where there is one.
    picture_off : array of the same shape and type, optional
        The same view with the laser off.
    options : SpotOptions, optional

    Returns
    -------
    SpotSearch
        With the spot, or None and the reason why there is none.

    Raises
    ------
    InputError
        If a picture is no picture, or the two do not match.
    """
    strip = strip_seen(picture, target, sighting, picture_off)
    try:
        spot = _found(strip, picture_off is not None, options or SpotOptions())
    except NoSpotError as none:
        return SpotSearch(None, str(none))
    return SpotSearch(spot, f"spot found at {listed(spot.uv[None])}")


def _found(strip: Strip, pair: bool, options: SpotOptions) -> SpotSighting:
    refusals.refuse_full(strip, options)
    rough = _brightest(strip, strip.paper)
    refusals.refuse_along(strip, rough)
    refusals.refuse_faint(strip, rough, pair, options)
    assert rough is not None  # else refused as faint
    refusals.refuse_moved(strip, rough, options)
    line = refusals.refuse_short(strip, _measured(strip, rough), rough, options)
    spot = _crossing(strip.axis, line)
    refusals.refuse_oblique(spot, options)
    refusals.refuse_unlike_line(strip, line, options)
    if not pair:
        refusals.refuse_hidden_marker(strip, line)
    refusals.refuse_second(strip, line, _brightest(strip, _beside(strip, line)), options)
    refusals.refuse_off_target(strip, spot)
    refusals.refuse_uncertain(spot, options)
    return spot


def _brightest(strip: Strip, where: NDArray[np.bool_]) -> RoughLine | None:
    return brightest_line(strip.band, strip.laser, where, strip.light.noise_std)


def _measured(strip: Strip, rough: RoughLine) -> StraightLine | None:
    """The line by two fits, the second to the pixels about what the first has found."""
    line, noise = None, strip.light.noise_std
    for _ in range(2):
        pixels = strip.pixels(rough, _FITTED_WIDTHS * rough.width + _FITTED_PX)
        if len(pixels) < _FEWEST_PIXELS:
            return None
        line = fitted_line_of_light(pixels, rough, noise, strip.light.least_std)
        if line is None:
            return None
        rough = line.rough
    return line


def _beside(strip: Strip, line: StraightLine) -> NDArray[np.bool_]:
    """The paper well clear of a line."""
    a, n = np.meshgrid(strip.band.a, strip.band.n)
    rough = line.rough
    return strip.paper & (np.abs(rough.distance(a, n)) > _LIT_WIDTHS * rough.width + _FITTED_PX)


def _crossing(axis: TargetAxis, line: StraightLine) -> SpotSighting:
    """Where the line ``a = a0 + n tan φ`` meets the axis ``n = p(a)``."""
    place, tilt = (float(value) for value in line.values[:2])
    a = place
    for _ in range(20):
        a = place + axis.across(a) * np.tan(tilt)
    n, across_std = axis.across(a), axis.across_std(a)
    slopes = np.array([1.0, n / np.cos(tilt) ** 2])
    along = slopes @ line.covariance @ slopes
    std = float(np.sqrt(along + (np.tan(tilt) * across_std) ** 2))
    angle = float(np.arcsin(min(abs(np.cos(tilt)), 1.0)))
    return SpotSighting(axis.uv(np.array(a), np.array(n)), std, across_std, angle)
