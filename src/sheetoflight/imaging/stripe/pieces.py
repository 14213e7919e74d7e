"""The pieces of the laser line in one picture, their centres and their ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres
from sheetoflight.imaging.stripe.ends import LineEnd, line_end
from sheetoflight.imaging.stripe.light import LineLight, line_light
from sheetoflight.imaging.stripe.linking import linked
from sheetoflight.imaging.stripe.ridges import ridges
from sheetoflight.imaging.stripe.tracks import centres_along, unbroken
from sheetoflight.model.line_piece import LinePiece

_LEAST_CENTRES = 5
_LEAST_PICTURE_PX = 8
_BRIGHT_QUANTILE = 0.98


@dataclass(frozen=True)
class PieceOptions:
    """What counts as a piece of the line.

    Parameters
    ----------
    seed_snr : float
        Amplitude that a piece must reach somewhere, in standard deviations of the noise.
    least_snr : float
        Amplitude that it must keep, in standard deviations of the noise.
    least_length_px : float
        Shorter pieces are dropped.
    least_widths : float
        Pieces shorter than this many standard deviations of their profile are dropped.
    least_contrast : float
        Amplitude of the faintest piece as a part of the brightest one's where an off-picture
        has removed the background.
    least_contrast_single : float
        The same for a single picture, where anything bright and narrow looks like a line.
    """

    seed_snr: float = 6.0
    least_snr: float = 3.0
    least_length_px: float = 12.0
    least_widths: float = 6.0
    least_contrast: float = 0.08
    least_contrast_single: float = 0.25

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value}", "give a number of 0 or more")


def line_pieces(
    image_on: NDArray[Any],
    image_off: NDArray[Any] | None = None,
    options: PieceOptions | None = None,
) -> tuple[LinePiece, ...]:
    """Find the pieces of the laser line.

    Parameters
    ----------
    image_on : (H, W) or (H, W, 3) array
        Picture with the laser on; uint8, uint16 or float.
    image_off : array of the same shape and type, optional
        Picture of the same scene with the laser off.
    options : PieceOptions, optional

    Returns
    -------
    tuple of LinePiece
        From top to bottom, then from left to right of the first end. The first end is the upper
        one of a steep piece, the left one of a flat one. Where no clear edge ends the piece (it
        leaves the picture, fades, or goes on round a sharp bend) the end is where its light
        was last followed to, the end's standard uncertainty is NaN, and the piece is not whole.

    Raises
    ------
    InputError
        If a picture is no picture, or the two do not match.
    """
    options = options or PieceOptions()
    light = line_light(image_on, image_off)
    runs = [_in_reading_order(run) for run in _runs(light, options)]
    pieces = [_piece(light, run, _all_but(runs, i)) for i, run in enumerate(runs)]
    long_enough = [piece for piece in pieces if len(piece) >= _LEAST_CENTRES]
    return tuple(sorted(long_enough, key=lambda piece: (piece.ends[0, 1], piece.ends[0, 0])))


def _runs(light: LineLight, options: PieceOptions) -> list[Centres]:
    """Unbroken runs of centres that are long and bright enough."""
    if min(light.picture.shape) < _LEAST_PICTURE_PX or light.noise_std == 0.0:
        return []
    least = options.least_snr * light.noise_std
    found = ridges(light.picture, least)
    if len(found) == 0:
        return []
    part = options.least_contrast if light.differenced else options.least_contrast_single
    contrast = part * float(np.quantile(found.strength, _BRIGHT_QUANTILE))
    seed = max(options.seed_snr * light.noise_std, contrast)
    # A piece may fade to half of what it must reach somewhere.
    found = found.taken(found.strength >= max(least, contrast / 2.0))
    chains = linked(found, seed, int(options.least_length_px) // 2)
    return [
        run
        for chain in chains
        for run in unbroken(centres_along(light, found, chain), seed / 2.0)
        if np.median(run.amplitude) >= seed and _is_long_enough(run, options)
    ]


def _is_long_enough(run: Centres, options: PieceOptions) -> bool:
    width = float(np.median(run.width))
    length = float(np.linalg.norm(run.uv[-1] - run.uv[0]))
    return length >= max(options.least_length_px, options.least_widths * width)


def _in_reading_order(run: Centres) -> Centres:
    du, dv = run.uv[-1] - run.uv[0]
    backwards = dv < 0 if abs(dv) >= abs(du) else du < 0
    return run.taken(slice(None, None, -1)) if backwards else run


def _all_but(runs: list[Centres], index: int) -> Array:
    others = [run.uv for i, run in enumerate(runs) if i != index]
    return np.concatenate([np.empty((0, 2)), *others])


def _piece(light: LineLight, run: Centres, others: Array) -> LinePiece:
    last = line_end(light, run, others)
    first = line_end(light, run.taken(slice(None, None, -1)), others)
    inner = _clear_of(first, run) & _clear_of(last, run)
    return LinePiece(
        uv=run.uv[inner],
        std=run.std[inner],
        ends=np.stack([first.uv, last.uv]),
        ends_std=np.array([first.std, last.std]),
        whole=first.seen and last.seen,
    )


def _clear_of(end: LineEnd, run: Centres) -> NDArray[np.bool_]:
    """Centres whose rows or columns the fall of light at the end does not touch."""
    return (run.uv - end.uv) @ end.direction <= -end.reach
