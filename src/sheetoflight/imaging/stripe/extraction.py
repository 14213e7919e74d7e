"""From pictures to the laser line's centres."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres, Located
from sheetoflight.imaging.stripe.choice import Choice, chosen_detector
from sheetoflight.imaging.stripe.colour import laser_light
from sheetoflight.imaging.stripe.detectors import DETECTORS
from sheetoflight.imaging.stripe.ends import line_ends
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.lines import LineOptions, found_lines, other_centres
from sheetoflight.imaging.stripe.phase import phase_std
from sheetoflight.imaging.stripe.region import Region, at_pixels, check_mask, within
from sheetoflight.imaging.stripe.scanning import ScanAlong, scanned_stripe
from sheetoflight.imaging.stripe.selection import Which, selected
from sheetoflight.imaging.stripe.speckle import Speckle
from sheetoflight.imaging.stripe.tracks import tracks_of
from sheetoflight.model.stripe import Stripe, joined_lines, no_stripe

_TANGENT_CENTRES = 15

# Where the picture's border cuts off more than the outer flank, too little of the profile is left.
_WHOLE_WIDTHS = 1.0


@dataclass(frozen=True)
class StripeOptions:
    """How the laser line is looked for.

    Parameters
    ----------
    detector : str
        A name of `sheetoflight.imaging.stripe.detectors.DETECTORS`, or ``auto``.
    lines : str
        Where several lines cross the same row (column, if they run along the rows): ``all`` of
        them, the ``brightest``, the ``first`` from the left (top), or the ``last``.
    scan : str, optional
        For profile sensors, at camera rate: one centre in every one of the ``columns``, or of the
        ``rows``. Where absent, lines of any direction are looked for everywhere.
    region : (u, v, width, height), optional
        Where to look, px; the whole picture where absent.
    mask : (H, W) bool array, optional
        True where to look.
    speckle : Speckle, optional
        What causes the speckle; no centre is then stated to be better than it allows.
    line : LineOptions
        What counts as a line.

    Raises
    ------
    InputError
        If the detector or the choice of lines is not known.
    """

    detector: str = "auto"
    lines: Which = "all"
    scan: ScanAlong | None = None
    region: Region | None = None
    mask: NDArray[np.bool_] | None = field(default=None, compare=False)
    speckle: Speckle | None = None
    line: LineOptions = field(default_factory=LineOptions)

    def __post_init__(self) -> None:
        names = ("auto", *DETECTORS)
        if self.detector not in names:
            raise InputError(
                f"the detector {self.detector!r} is not known", f"choose {' | '.join(names)}"
            )
        if self.lines not in get_args(Which):
            raise InputError(
                f"which lines: {self.lines!r} is not known",
                f"choose {' | '.join(get_args(Which))}",
            )
        if self.scan is not None and self.scan not in get_args(ScanAlong):
            raise InputError(
                f"scan: {self.scan!r} is not known", f"choose {' | '.join(get_args(ScanAlong))}"
            )
        if self.scan is not None and self.lines in ("first", "last"):
            raise InputError(
                f"scan finds the brightest line only, the {self.lines} is asked for",
                "leave out scan",
            )


def extract_stripe(
    image: NDArray[Any],
    image_off: NDArray[Any] | None = None,
    options: StripeOptions | None = None,
) -> Stripe:
    """Find the laser line and its centres.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        Picture with the laser on: grey, or colour in any order of its channels; uint8, uint16 or
        float.
    image_off : array of the same shape and type, optional
        Picture of the same scene with the laser off.
    options : StripeOptions, optional

    Returns
    -------
    Stripe
        Empty where there is no line. ``good`` is False near the ends of a line, where the fall of
        light bends it, where the picture's border cuts its profile, and where the detector did not
        come to rest; centres that it did not find at all are left out.

    Raises
    ------
    InputError
        If a picture is no picture, the two do not match, or region or mask do not fit.

    Examples
    --------
    >>> v, u = np.indices((60, 80))
    >>> picture = 20 + 200 * np.exp(-0.5 * ((v - 31.3 - 0.1 * u) / 1.5) ** 2)
    >>> stripe = extract_stripe(np.rint(picture).astype(np.uint8))
    >>> u, v = stripe.uv[stripe.good].T
    >>> bool(np.abs(v - 31.3 - 0.1 * u).max() < 0.02)
    True
    """
    options = options or StripeOptions()
    if options.scan is not None:
        return _scanned(image, image_off, options.scan, options)
    light, origin = within(laser_light(image, image_off), options.region, options.mask)
    runs = found_lines(light, options.line)
    choice = chosen_detector(light, runs)
    if options.detector != "auto":
        choice = Choice(options.detector, "asked for")
    nothing = no_stripe(light.noise_std, choice.detector, choice.reason)
    parts = []
    for index, run in enumerate(runs):
        _, _, clear = line_ends(light, run, other_centres(runs, index))
        parts.append(_line(nothing, light, run, clear, options.speckle))
    stripe = selected(joined_lines(nothing, parts), options.lines)
    return replace(stripe, uv=stripe.uv + origin)


def _scanned(
    image: NDArray[Any], image_off: NDArray[Any] | None, along: ScanAlong, options: StripeOptions
) -> Stripe:
    """One centre in every column or row of the region, those outside the mask left out."""
    found = scanned_stripe(
        image, image_off, along, options.detector, options.region, options.speckle
    )
    check_mask(options.mask, np.shape(image))
    return found if options.mask is None else found.taken(at_pixels(options.mask, found.uv))


def _line(
    nothing: Stripe,
    light: LineLight,
    run: Centres,
    clear: NDArray[np.bool_],
    speckle: Speckle | None,
) -> Stripe:
    """One line's centres by the detector that `nothing` names."""
    located = _located(light, run, nothing.detector)
    std = located.std if speckle is None else np.maximum(located.std, speckle.std(run.width))
    across = _across(run.uv)
    stripe = replace(
        nothing,
        uv=located.uv,
        std=std,
        width=run.width,
        peak=run.amplitude,
        across=across,
        line=np.zeros(len(run), dtype=np.int64),
        good=located.good & clear & _inside(light, run, across),
    )
    return stripe.taken(np.isfinite(std) & np.isfinite(located.uv).all(axis=1))


def _located(light: LineLight, run: Centres, detector: str) -> Located:
    if detector == "gaussian":  # by which the run was found
        return Located(run.uv, run.std, run.good)
    centres = DETECTORS[detector].centres
    tracks = tracks_of(run)
    found = [centres(light, track) for track in tracks]
    phase = np.concatenate([phase_std(centres, track) for track in tracks])
    return Located(
        np.concatenate([part.uv for part in found]),
        np.hypot(np.concatenate([part.std for part in found]), phase),
        np.concatenate([part.good for part in found]),
    )


def _inside(light: LineLight, run: Centres, across: Array) -> NDArray[np.bool_]:
    """Whether the heart of the profile in each centre's row or column lies in the picture."""
    height, width = light.picture.shape
    own = np.where(run.by_rows, 0, 1)
    index = np.arange(len(run))
    place, limit = run.uv[index, own], np.where(run.by_rows, width, height) - 1.0
    reach = _WHOLE_WIDTHS * run.width / np.maximum(np.abs(across[index, own]), 0.5)
    return (place >= reach - 0.5) & (place <= limit - reach + 0.5)


def _across(uv: Array) -> Array:
    """Unit directions across a run of centres ``(N, 2)``, from their neighbours."""
    if len(uv) < 2:
        return np.tile([1.0, 0.0], (len(uv), 1))
    size = min(_TANGENT_CENTRES, len(uv))
    along = uniform_filter1d(np.gradient(uv, axis=0), size, axis=0, mode="nearest")
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([-along[:, 1], along[:, 0]], axis=-1)
