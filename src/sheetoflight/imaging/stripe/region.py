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
    check_mask(mask, light.picture.shape)
    if mask is not None:
        light = replace(light, wanted=mask.astype(bool))
    part, origin = part_of(light.picture.shape, region)
    cropped = replace(
        light,
        picture=np.ascontiguousarray(light.picture[part]),
        full=light.full[part],
        wanted=None if light.wanted is None else light.wanted[part],
        channels=None if light.channels is None else light.channels[part],
        background=None if light.background is None else light.background[part],
    )
    return cropped, origin


def part_of(shape: tuple[int, ...], region: Region | None) -> tuple[tuple[slice, slice], Array]:
    """Rows and columns of a region in a picture of a shape, and its origin ``(2,)``, px.

    Raises
    ------
    InputError
        If the region does not lie in the picture.
    """
    if region is None:
        return (slice(None), slice(None)), np.zeros(2)
    height, width = shape[:2]
    left, top, wide, tall = region
    if wide < 1 or tall < 1 or left < 0 or top < 0 or left + wide > width or top + tall > height:
        raise InputError(
            f"the region {left},{top},{wide},{tall} does not lie in the picture of "
            f"{width}×{height} pixels",
            "give left, top, width and height in pixels",
        )
    part = (slice(top, top + tall), slice(left, left + wide))
    return part, np.array([left, top], dtype=float)


def check_mask(mask: NDArray[np.bool_] | None, shape: tuple[int, ...]) -> None:
    """Refuse a mask of another size than the picture's.

    Raises
    ------
    InputError
    """
    if mask is not None and mask.shape != tuple(shape[:2]):
        raise InputError(
            f"the mask has shape {mask.shape}, the picture {tuple(shape[:2])}",
            "give a mask of the picture's height and width, True where to look",
        )


def at_pixels(mask: NDArray[np.bool_], uv: Array) -> NDArray[np.bool_]:
    """The mask at the pixels nearest to image points ``(N, 2)``."""
    height, width = mask.shape
    columns, rows = np.rint(uv).astype(np.int64).T
    return mask[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
