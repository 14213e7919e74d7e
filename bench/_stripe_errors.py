"""Errors of the laser line's centres on drawn lines, and what is found where there is no line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench._drawn_stripes import DrawnLine
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe

_AT_THE_LINE_WIDTHS = 3.0
_SAME_ROW_PX = 0.75  # near 45° rows and columns stand in for each other


@dataclass(frozen=True)
class Errors:
    """Errors of the centres in pictures of the same line at several offsets.

    Parameters
    ----------
    line : DrawnLine
        Of one of the pictures: the bounds are the same for all.
    detector : str
        What found the centres.
    errors, std : (N,) arrays
        Signed errors across the line and their stated standard uncertainties, px, of the centres
        that are called good and lie within 3 widths of the line.
    picture : (N,) int array
        The picture of each.
    false : int
        Good centres further off.
    found : float
        Part of the rows (columns) that the lines cross with such a centre.
    """

    line: DrawnLine
    detector: str
    errors: Array
    std: Array
    picture: NDArray[np.int64]
    false: int
    found: float

    @property
    def rms(self) -> float:
        """Root mean square error, px."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def over_bound(self) -> float:
        """`rms` over the bound of the pixels."""
        return self.rms / self.line.pixel_bound

    @property
    def over_formula(self) -> float:
        """`rms` over 1.062 √w σ/A."""
        return self.rms / self.line.formula_bound

    @property
    def bias(self) -> float:
        """Mean error, px."""
        return float(np.mean(self.errors))

    @property
    def bias_std(self) -> float:
        """Standard error of the mean, px."""
        return self.rms / float(np.sqrt(len(self.errors)))

    @property
    def pull(self) -> float:
        """Root mean square of error over stated uncertainty."""
        return float(np.sqrt(np.mean((self.errors / self.std) ** 2)))

    @property
    def by_phase(self) -> Array:
        """Mean error in each picture, px: along the rows each shows one sub-pixel phase."""
        pictures = np.unique(self.picture)
        return np.array([self.errors[self.picture == one].mean() for one in pictures])


def stripe_errors(
    line: DrawnLine, pictures: int, seed: int, options: StripeOptions | None = None
) -> Errors:
    """Draw a line so many times, its offsets spread evenly over a pixel, and find it.

    Parameters
    ----------
    line : DrawnLine
        Where its noise is 0 the picture is not rounded either: whole grey levels without noise
        move all columns of a line along the rows alike.
    pictures : int
    seed : int
    options : StripeOptions, optional
    """
    rng = np.random.default_rng(seed)
    errors, std, numbers, detector = [], [], [], ""
    false, found, expected = 0, 0, 0
    offsets = (np.arange(pictures) + rng.uniform()) / pictures - 0.5
    for index, offset in enumerate(offsets):
        drawn = replace(line, offset=line.offset + float(offset))
        picture = drawn.recorded(rng) if line.noise > 0.0 else drawn.picture
        stripe = extract_stripe(picture, options=options)
        detector = stripe.detector
        off = drawn.distances(stripe.uv)
        near = np.abs(off) < _AT_THE_LINE_WIDTHS * line.width
        used = stripe.good & near
        false += int((stripe.good & ~near).sum())
        errors.append(off[used])
        std.append(stripe.std[used])
        numbers.append(np.full(int(used.sum()), index))
        found += _found(drawn, stripe.uv[used])
        expected += len(drawn.crossed)
    return Errors(
        line,
        detector,
        np.concatenate(errors),
        np.concatenate(std),
        np.concatenate(numbers),
        false,
        found / expected,
    )


def _found(drawn: DrawnLine, uv: Array) -> int:
    """How many of the crossed rows (columns) have a centre, be it that of a column (row)."""
    axis = 1 if drawn.by_rows else 0
    gaps = np.abs(np.subtract.outer(drawn.crossed, uv[:, axis]))
    return int((gaps.min(axis=1, initial=np.inf) < _SAME_ROW_PX).sum())
