"""The lines in one picture: unbroken runs of centres, found wherever they run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.added import Seen, adds_light
from sheetoflight.imaging.stripe.bridging import bridged
from sheetoflight.imaging.stripe.brightness import least_by_brightness
from sheetoflight.imaging.stripe.centres import Centres
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.linking import linked
from sheetoflight.imaging.stripe.reflections import without_reflections
from sheetoflight.imaging.stripe.ridges import ridges
from sheetoflight.imaging.stripe.tracks import centres_along, unbroken

_LEAST_PICTURE_PX = 8
_BRIGHT_QUANTILE = 0.98

# Mean amplitude of a run over its own standard uncertainty. Among the 10^5 places and directions
# of a large picture noise alone reaches 5; texture, whose neighbours are alike, reaches more.
_LEAST_SIGNIFICANCE = 10.0


@dataclass(frozen=True)
class LineOptions:
    """What counts as a line.

    Parameters
    ----------
    seed_snr : float
        Amplitude that a line must reach somewhere, in standard deviations of the noise.
    least_snr : float
        Amplitude that it must keep, in standard deviations of the noise.
    least_length_px : float
        Shorter lines are dropped.
    least_widths : float
        Lines shorter than this many standard deviations of their profile are dropped.
    least_contrast : float
        Amplitude of the faintest line as a part of the brightest one's where an off-picture
        has removed the background.
    least_contrast_single : float
        The same for a single picture, where anything bright and narrow looks like a line.
    """

    seed_snr: float = 2.0
    least_snr: float = 1.0
    least_length_px: float = 12.0
    least_widths: float = 6.0
    least_contrast: float = 0.08
    least_contrast_single: float = 0.25

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value}", "give a number of 0 or more")


def found_lines(light: LineLight, options: LineOptions) -> list[Centres]:
    """Unbroken runs of centres that are long and bright enough.

    Each runs downwards where it is steep, to the right where it is flat. The centres are those of
    `sheetoflight.imaging.stripe.gaussian.fitted_centres`.
    """
    if min(light.picture.shape) < _LEAST_PICTURE_PX or light.noise_std == 0.0:
        return []
    least = options.least_snr * light.noise_std
    found = ridges(light, least)
    if len(found) == 0:
        return []
    part = options.least_contrast if light.differenced else options.least_contrast_single
    brightest = float(np.quantile(found.strength, _BRIGHT_QUANTILE))
    contrast = part * brightest
    seed = max(options.seed_snr * light.noise_std, contrast)
    # A line may fade to half of what it must reach somewhere.
    found = found.taken(found.strength >= max(least, contrast / 2.0))
    # A pair shows at least what a single picture would.
    clear = np.minimum(least_by_brightness(light, found), options.least_contrast_single * brightest)
    found = found.taken(found.strength >= clear)
    chains = linked(found, seed, int(options.least_length_px) // 2)
    runs = [
        _in_reading_order(run)
        for chain in bridged(found, chains)
        for run in unbroken(centres_along(light, found, chain), seed / 2.0)
        if np.median(run.amplitude) >= seed
        and _is_line(run, options)
        and adds_light(light, _seen(run))
    ]
    return without_reflections(runs)


def other_centres(runs: list[Centres], index: int) -> Array:
    """Centres ``(M, 2)`` of all runs but one, px."""
    others = [run.uv for i, run in enumerate(runs) if i != index]
    return np.concatenate([np.empty((0, 2)), *others])


def _is_line(run: Centres, options: LineOptions) -> bool:
    width = float(np.median(run.width))
    length = float(np.linalg.norm(np.ptp(run.uv, axis=0)))  # a ring ends where it begins
    significance = np.median(run.amplitude / run.amplitude_std) * np.sqrt(len(run))
    long_enough = length >= max(options.least_length_px, options.least_widths * width)
    return long_enough and bool(significance >= _LEAST_SIGNIFICANCE)


def _seen(run: Centres) -> Seen:
    step = np.gradient(run.uv, axis=0)
    across = np.stack([-step[:, 1], step[:, 0]], axis=-1)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return Seen(run.uv, across, run.width, run.amplitude)


def _in_reading_order(run: Centres) -> Centres:
    du, dv = run.uv[-1] - run.uv[0]
    backwards = dv < 0 if abs(dv) >= abs(du) else du < 0
    return run.taken(slice(None, None, -1)) if backwards else run
