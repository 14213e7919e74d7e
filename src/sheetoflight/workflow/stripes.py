"""The laser line in pictures and streams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from sheetoflight.io.frames import DamagedFrame, Frame
from sheetoflight.io.pictures import Picture, read_picture
from sheetoflight.io.quoting import file_name
from sheetoflight.model.stripe import Stripe
from sheetoflight.workflow.spread import ALONE, Execution
from sheetoflight.workflow.streamed import stream

WHAT = "find the line"


def find_stripes(
    frames: Sequence[Frame],
    options: StripeOptions | None = None,
    background: Picture | None = None,
    run: Execution = ALONE,
) -> Iterator[tuple[Frame, Stripe | DamagedFrame]]:
    """The laser line in every frame, in order, at constant memory.

    Parameters
    ----------
    frames : sequence of Frame
        See `sheetoflight.io.frames.list_frames`.
    options : StripeOptions, optional
    background : (H, W) or (H, W, 3) array, optional
        A picture of the scene with the laser off, for the frames that have no such partner.
    run : Execution
    """
    work = partial(stripe_of, options=options or StripeOptions(), background=background)
    return stream(work, frames, WHAT, run)


def mask_of(path: Path) -> np.ndarray:
    """A picture that is bright where to look, as a mask ``(H, W)``.

    Raises
    ------
    FileError
        If it cannot be read.
    InputError
        If it is black.
    """
    picture = read_picture(path)
    grey = picture if picture.ndim == 2 else picture.max(axis=2)
    mask = grey > grey.max() // 2
    if not mask.any():
        raise InputError(f"the mask {file_name(path)} is black", "paint white where to look")
    return mask


def stripe_of(
    _frame: Frame,
    on: Picture,
    off: Picture | None,
    options: StripeOptions,
    background: Picture | None,
) -> Stripe:
    """The laser line in one frame; see `find_stripes`."""
    return extract_stripe(on, off if off is not None else background, options)
