"""Where in the picture the line is looked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.light import LineLight

Region = tuple[int, int, int, int]
"""Left, top, width and height, px."""


def within(
    light: LineLight, region: Region | None, mask: NDArray[np.bool_] | None
) -> tuple[LineLight, Array]:
    """The light of a region, lines wanted only where the mask is true; and the region's origin.

    Raises
    ------
    InputError
        If the region does not lie in the picture, or the mask has another shape than it.
    """
    height, width = light.picture.shape
    if mask is not None:
        if mask.shape != light.picture.shape:
            raise InputError(
                f"the mask has shape {mask.shape}, the picture {light.picture.shape}",
                "give a mask of the picture's height and width, True where to look",
            )
        light = replace(light, wanted=mask.astype(bool))
    if region is None:
        return light, np.zeros(2)
    left, top, wide, tall = region
    if wide < 1 or tall < 1 or left < 0 or top < 0 or left + wide > width or top + tall > height:
        raise InputError(
            f"the region {left},{top},{wide},{tall} does not lie in the picture of "
            f"{width}×{height} pixels",
            "give left, top, width and height in pixels",
        )
    part = (slice(top, top + tall), slice(left, left + wide))
    cropped = replace(
        light,
        picture=np.ascontiguousarray(light.picture[part]),
        full=light.full[part],
        wanted=None if light.wanted is None else light.wanted[part],
        channels=None if light.channels is None else light.channels[part],
    )
    return cropped, np.array([left, top], dtype=float)
