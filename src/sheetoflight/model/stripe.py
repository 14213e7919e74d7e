"""The laser line's centres in one picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class Stripe:
    """Centres of the laser line in one picture, line by line, in order along each line.

    Parameters
    ----------
    uv : (N, 2) array
        Centres, px.
    std : (N,) array
        Standard uncertainty of each centre across the line, px.
    width : (N,) array
        Standard deviation of the line's profile across the line, px.
    peak : (N,) array
        Height of the line over its surroundings, grey levels.
    across : (N, 2) array
        Unit direction across the line in which `std` counts.
    line : (N,) int array
        Which line of the picture each centre belongs to, from 0 on.
    good : (N,) bool array
        Whether the centre can be trusted within its `std`; False at the ends of a line, where the
        fall of light moves it, beside gaps, and where the fit did not come to rest.
    noise_std : float
        Standard deviation of the picture's noise away from the line, grey levels.
    detector : str
        What found the centres.
    reason : str
        Why this detector: what the user asked for, or what was seen.

    Raises
    ------
    InputError
        If the arrays do not belong together.
    """

    uv: Array
    std: Array
    width: Array
    peak: Array
    across: Array
    line: NDArray[np.int64]
    good: NDArray[np.bool_]
    noise_std: float
    detector: str
    reason: str

    def __post_init__(self) -> None:
        count = len(self.uv)
        shapes = {name: np.shape(getattr(self, name)) for name in _PER_CENTRE}
        for name, shape in shapes.items():
            expected = (count, 2) if name in ("uv", "across") else (count,)
            if shape != expected:
                raise InputError(
                    f"{name} of a stripe has shape {shape}, expected {expected}",
                    "give one value for each centre",
                )

    def __len__(self) -> int:
        return len(self.uv)

    @property
    def lines(self) -> int:
        """How many lines there are."""
        return int(self.line.max()) + 1 if len(self.line) else 0

    def taken(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Stripe:
        """Some of the centres."""
        return replace(self, **{name: getattr(self, name)[index] for name in _PER_CENTRE})

    def with_lines(self, line: NDArray[np.int64]) -> Stripe:
        """The same centres, each said to belong to another line."""
        return replace(self, line=line)


_PER_CENTRE = ("uv", "std", "width", "peak", "across", "line", "good")


def no_stripe(noise_std: float, detector: str, reason: str) -> Stripe:
    """The stripe of a picture without a line."""
    none, pairs = np.empty(0), np.empty((0, 2))
    return Stripe(
        uv=pairs,
        std=none,
        width=none,
        peak=none,
        across=pairs,
        line=np.empty(0, dtype=np.int64),
        good=np.empty(0, dtype=bool),
        noise_std=noise_std,
        detector=detector,
        reason=reason,
    )


def joined_lines(nothing: Stripe, lines: list[Stripe]) -> Stripe:
    """Stripes of one line each as one stripe, the lines numbered in their order.

    Parameters
    ----------
    nothing : Stripe
        What is joined to, for what all centres share.
    lines : list of Stripe
    """
    parts = [nothing, *(one.with_lines(np.full(len(one), i)) for i, one in enumerate(lines))]
    return replace(
        nothing,
        **{name: np.concatenate([getattr(one, name) for one in parts]) for name in _PER_CENTRE},
    )
