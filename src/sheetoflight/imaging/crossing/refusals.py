"""Why a picture's spot is not believed."""

from __future__ import annotations

import numpy as np

from sheetoflight.imaging.crossing.fit import AMPLITUDE, TILT, WIDTH, StraightLine
from sheetoflight.imaging.crossing.outcome import NoSpotError, SpotOptions, SpotSighting
from sheetoflight.imaging.crossing.search import RoughLine
from sheetoflight.imaging.crossing.strip import Strip
from sheetoflight.imaging.markers.sighting import listed

_STEEP_EDGE = 0.3
_EDGE_QUANTILE = 0.95
_CLEAR_WIDTHS = 6.0
_LEAST_EDGE_PLACES = 40
_SIGNIFICANT = 5.0
_FEWEST_ROWS = 4
_LIT_WIDTHS = 2.0
_PLANE = "the target lies in the sheet: that is a picture for stage plane"


def refuse_full(strip: Strip, options: SpotOptions) -> None:
    """The paper itself is at the end of the scale."""
    full = strip.band.read(strip.light.full.astype(np.float32)) > 0
    share = float(full[strip.paper].mean()) if strip.paper.any() else 0.0
    if share > options.most_full:
        raise NoSpotError(
            f"{share:.0%} of the target's strip is saturated, so that a line hardly shows; "
            "expose for less time"
        )


def refuse_along(strip: Strip, rough: RoughLine | None) -> None:
    """A line runs along the target."""
    used = np.isfinite(strip.along)
    if used.sum() < _FEWEST_ROWS:
        raise NoSpotError(
            "too little plain paper is seen on the target's strip to find a line on it"
        )
    n, light = strip.band.n[used], strip.along[used]
    ridge = light - np.polyval(np.polyfit(n, light, 1), n)
    least = _SIGNIFICANT * strip.light.noise_std / np.sqrt(len(strip.band.a))
    crossing = rough.amplitude if rough else 0.0
    if ridge.max() > max(least, 0.3 * crossing, strip.light.noise_std):
        raise NoSpotError(f"the laser's line runs along the target; {_PLANE}")


def refuse_faint(strip: Strip, rough: RoughLine | None, pair: bool, options: SpotOptions) -> None:
    """No line stands out of the noise."""
    if (
        rough is None
        or rough.significance < options.least_significance
        or rough.amplitude < options.least_amplitude * strip.light.noise_std
    ):
        shown = "the two pictures differ in no line on the strip" if pair else "no line is seen"
        raise NoSpotError(
            f"no laser line on the target's strip: {shown}; check that the laser was on, and that "
            "its sheet meets the strip between the target's ends"
        )


def refuse_moved(strip: Strip, rough: RoughLine, options: SpotOptions) -> None:
    """The markers' edges are left in the difference of a pair: ``on − off = δ · ∇off``."""
    if strip.light.background is None:
        return
    off = strip.band.read(strip.light.background)
    slopes = np.gradient(off)
    steep = np.hypot(slopes[0], slopes[1])
    a, n = np.meshgrid(strip.band.a, strip.band.n)
    clear = np.abs(rough.distance(a, n)) > _CLEAR_WIDTHS * rough.width + 3.0
    clear &= strip.band.inside & strip.band.on_target
    edge = clear & (steep > _STEEP_EDGE * np.quantile(steep[clear], _EDGE_QUANTILE))
    if edge.sum() < _LEAST_EDGE_PLACES:
        return
    design = np.stack([slopes[0][edge], slopes[1][edge], off[edge], np.ones(edge.sum())], axis=-1)
    light = strip.band.read(strip.light.picture)[edge]
    solution, *_ = np.linalg.lstsq(design, light, rcond=None)
    moved = float(np.hypot(*solution[:2]))
    left = float(np.std(light - design @ solution))
    std = left * float(np.sqrt(np.trace(np.linalg.pinv(design.T @ design)[:2, :2])))
    if moved > options.most_moved_px and moved > _SIGNIFICANT * std:
        raise NoSpotError(
            f"the target moved by about {moved:.1f} px between the pictures with the laser off and "
            "on; take both without touching it"
        )


def refuse_second(
    strip: Strip, line: StraightLine, second: RoughLine | None, options: SpotOptions
) -> None:
    """Another line crosses the strip, nearly as bright: one is a reflection."""
    if second is None or second.significance < options.least_significance:
        return
    if second.amplitude < max(
        options.second * line.values[AMPLITUDE],
        options.least_amplitude * strip.light.noise_std,
    ):
        return
    places = listed(strip.axis.uv(np.array([line.values[0], second.place]), np.zeros(2)))
    raise NoSpotError(
        f"two lines cross the target's strip, at {places}; one may be a reflection, or of another "
        "laser: cover it, and take one picture for each laser"
    )


def refuse_hidden_marker(strip: Strip, line: StraightLine) -> None:
    """In a single picture the line's light in a marker displaces what is taken for its centre."""
    axis = strip.axis
    tilt, width = line.values[TILT], line.values[WIDTH]
    reach = np.hypot(axis.half_length * np.cos(tilt), axis.half_height * np.sin(tilt))
    away = np.abs(line.rough.distance(axis.markers, np.zeros(len(axis.markers))))
    hidden = np.flatnonzero(away < reach + _LIT_WIDTHS * width)
    if len(hidden):
        raise NoSpotError(
            f"the laser's line runs through marker {hidden[0]} and moves what is seen of its "
            "centre; take a picture with the laser off too (NAME_off, NAME_on), or let the sheet "
            "cross the target between markers"
        )


def refuse_short(
    strip: Strip, line: StraightLine | None, rough: RoughLine, options: SpotOptions
) -> StraightLine:
    """Too little of the line lies on plain paper."""
    if line is not None and line.lit >= options.least_length_px:
        return line
    near = int(np.argmin(np.abs(strip.axis.markers - rough.place)))
    away = abs(strip.axis.markers[near] - rough.place)
    if away < 2 * strip.axis.half_length[near]:
        raise NoSpotError(
            f"the laser's line runs through marker {near}, and too little of it lies on plain "
            "paper; let the sheet cross the target between markers"
        )
    raise NoSpotError(
        f"the light on the target's strip at {_place(strip, rough)} is no line that can be measured"
    )


def refuse_unlike_line(strip: Strip, line: StraightLine, options: SpotOptions) -> None:
    """What was measured is no straight narrow line."""
    at = _place(strip, line.rough)
    if line.values[WIDTH] > strip.axis.half_height.mean():
        raise NoSpotError(f"the light on the target's strip at {at} is too wide for a line")
    if line.rejected > options.most_rejected:
        raise NoSpotError(
            f"the light on the target's strip at {at} is not one straight line: "
            f"{line.rejected:.0%} of it lies elsewhere"
        )
    if line.values[AMPLITUDE] < 0:
        raise NoSpotError(f"the line at {at} is darker than the strip")


def refuse_oblique(spot: SpotSighting, options: SpotOptions) -> None:
    """The line is nearly parallel to the target."""
    angle = float(np.degrees(spot.angle))
    if angle < options.least_angle_deg:
        raise NoSpotError(
            f"the laser's line and the target meet at {angle:.0f}° only (at least "
            f"{options.least_angle_deg:.0f}°); {_PLANE}"
        )


def refuse_uncertain(spot: SpotSighting, options: SpotOptions) -> None:
    """The spot is hardly known."""
    if not spot.std <= options.most_std:
        raise NoSpotError(
            f"the spot at {listed(spot.uv[None])} is known to {spot.std:.1f} px only (at most "
            f"{options.most_std:g}); let more of the line fall on plain paper, or expose longer"
        )


def refuse_off_target(strip: Strip, spot: SpotSighting) -> None:
    """The line meets the axis beyond the strip's ends, or the picture's border."""
    a, _ = strip.axis.coordinates(spot.uv)
    last = np.array(strip.light.picture.shape[1::-1]) - 1
    seen = bool((spot.uv >= 0).all() and (spot.uv <= last).all())
    if not (seen and strip.band.a[0] <= a <= strip.band.a[-1]):
        raise NoSpotError(
            f"the laser's line meets the target's axis at {listed(spot.uv[None])}, beyond its end "
            "or the picture's border"
        )


def _place(strip: Strip, line: RoughLine) -> str:
    return listed(strip.axis.uv(np.array([line.place]), np.zeros(1)))
