"""One centre in every column or row of a picture, at camera rate, as a `Stripe`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.region import Region, part_of
from sheetoflight.imaging.stripe.scan.scanner import Detector, Scan, ScanOptions, scan
from sheetoflight.imaging.stripe.speckle import Speckle
from sheetoflight.model.stripe import Stripe

ScanAlong = Literal["columns", "rows"]

_REASON = "one centre in each of the {along}, as asked for with scan"
_DIRECTION_CENTRES = 9
_GAP, _JUMP_PX, _JUMP_WIDTHS = 2, 2.0, 2.0


def scanned_stripe(
    image: NDArray[Any],
    image_off: NDArray[Any] | None,
    along: ScanAlong,
    detector: str,
    region: Region | None = None,
    speckle: Speckle | None = None,
) -> Stripe:
    """The brightest line in every column or row.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array of uint8 or uint16
        Of a colour picture the brightest channel of each pixel counts.
    image_off : array of the same shape and type, optional
        Picture with the laser off. Halved with the picture where they have 16 bits.
    along : str
        ``columns`` or ``rows``.
    detector : str
        One of those of `ScanOptions`, or ``auto``, which is ``gaussian``.
    region : (u, v, width, height), optional
        Where to look, px; the whole picture where absent.
    speckle : Speckle, optional

    Raises
    ------
    InputError
        If a picture has other samples, the two do not match, the region does not lie in them, or
        the detector is not for scanning.
    """
    name = "gaussian" if detector == "auto" else detector
    if name not in get_args(Detector):
        raise InputError(
            f"the detector {name!r} does not scan",
            f"choose {' | '.join(get_args(Detector))}, or leave out scan",
        )
    frame = _frame(image, image_off)
    part, origin = part_of(frame.shape, region)
    options = ScanOptions(detector=name, along=along)  # pyright: ignore[reportArgumentType] – checked above
    found = scan(np.ascontiguousarray(frame[part]), options)
    stripe = _stripe(found, along, name, speckle)
    return replace(stripe, uv=stripe.uv + origin)


def _frame(image: NDArray[Any], image_off: NDArray[Any] | None) -> NDArray[Any]:
    on = _grey(image)
    if image_off is None:
        return on
    off = _grey(image_off)
    if on.shape != off.shape or on.dtype != off.dtype:
        raise InputError(
            f"the picture with the laser on has shape {on.shape} and type {on.dtype}, the one with "
            f"it off {off.shape} and {off.dtype}",
            "give two pictures of the same size and the same type",
        )
    if on.dtype == np.uint8:
        return on.astype(np.uint16) + np.uint16(256) - off
    return (on >> 1) + np.uint16(1 << 15) - (off >> 1)


def _grey(image: NDArray[Any]) -> NDArray[Any]:
    image = np.asarray(image)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"the picture has samples of type {image.dtype}", "scan takes 8 or 16 bit pictures"
        )
    if image.ndim == 3 and image.shape[2] in (1, 3):
        image = image.max(axis=2)
    if image.ndim != 2 or image.size == 0:
        raise InputError(
            f"the picture has shape {image.shape}, expected (H, W) or (H, W, 3)",
            "give a grey or a colour picture; drop a transparency channel",
        )
    return image


def _stripe(found: Scan, along: ScanAlong, detector: str, speckle: Speckle | None) -> Stripe:
    place = np.flatnonzero(found.good)
    across, width = found.across[place], found.width[place]
    slope = _slope(place, across)
    cosine = 1.0 / np.sqrt(1.0 + slope**2)
    std = found.std[place] * cosine
    if speckle is not None:
        std = np.maximum(std, speckle.std(width * cosine))
    swap = slice(None) if along == "columns" else slice(None, None, -1)
    normal = np.stack([-slope * cosine, cosine], axis=-1)
    return Stripe(
        uv=np.stack([place.astype(float), across], axis=-1)[:, swap],
        std=std,
        width=width * cosine,
        peak=found.peak[place],
        across=normal[:, swap],
        line=_lines(place, across, width, slope),
        good=np.ones(len(place), dtype=bool),
        noise_std=found.noise_std,
        detector=detector,
        reason=_REASON.format(along=along),
    )


def _slope(place: NDArray[np.int64], across: Array) -> Array:
    """How far the line moves from one column to the next; jumps left out by the median."""
    if len(place) < 2:
        return np.zeros(len(place))
    rate = np.gradient(across, place.astype(float))
    return median_filter(rate, size=min(_DIRECTION_CENTRES, len(place)), mode="nearest")


def _lines(
    place: NDArray[np.int64], across: Array, width: Array, slope: Array
) -> NDArray[np.int64]:
    """Numbers of the connected pieces."""
    if len(place) == 0:
        return np.empty(0, dtype=np.int64)
    step = np.diff(place)
    jump = np.abs(np.diff(across) - slope[1:] * step)
    broken = (step > _GAP) | (jump > _JUMP_PX + _JUMP_WIDTHS * width[1:])
    return np.concatenate([[0], np.cumsum(broken)]).astype(np.int64)
