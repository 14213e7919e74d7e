"""Points of an unknown scene, followed through the pictures of one camera."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.image_points import checked_points, seen_points


@dataclass(frozen=True, eq=False)
class PointMatches:
    """Image points of the same T points of a scene in V views; nobody knows where these are.

    Parameters
    ----------
    names : tuple of str
        A name for each of the V views, unique in the stage.
    uv : (V, T, 2) array
        Image point of each point in each view, px; NaN where it was not seen or not matched.
    std : (V, T) array, optional
        Standard uncertainty of each image coordinate in px; NaN or absent where unknown.
    numbers : (T,) int array, optional
        The points' own numbers, for messages and files; 0 … T − 1 where absent.

    Raises
    ------
    InputError
        If shapes disagree, a name or a number is not unique, or a std is not above zero.
    """

    names: tuple[str, ...] = ()
    uv: Array = field(default_factory=lambda: np.zeros((0, 0, 2)))
    std: Array | None = None
    numbers: np.ndarray | None = None

    def __post_init__(self) -> None:
        uv, std = checked_points(self.names, self.uv, self.std, "matched points")
        numbers = _checked_numbers(self.numbers, uv.shape[1])
        numbers.setflags(write=False)
        for name, array in (("uv", uv), ("std", std), ("numbers", numbers)):
            object.__setattr__(self, name, array)
        object.__setattr__(self, "names", tuple(self.names))

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def seen(self) -> np.ndarray:
        """``(V, T)`` mask of the points that were seen."""
        return seen_points(self.uv)

    @property
    def stds(self) -> Array:
        """``(V, T)`` std of the points, NaN where unknown."""
        assert self.std is not None  # set when the matches are made
        return self.std

    @property
    def labels(self) -> np.ndarray:
        """``(T,)`` the points' own numbers."""
        assert self.numbers is not None  # set when the matches are made
        return self.numbers

    def without(self, points: np.ndarray) -> PointMatches:
        """The matches with those of a mask ``(V, T)`` taken as not seen."""
        return replace(self, uv=np.where(points[..., None], np.nan, self.uv))


def _checked_numbers(numbers: np.ndarray | None, count: int) -> np.ndarray:
    given = np.arange(count) if numbers is None else np.array(numbers)
    if given.shape != (count,) or (given < 0).any() or (given % 1 != 0).any():
        raise InputError(
            f"numbers of {count} points have shape {given.shape}, or are no whole numbers from 0",
            "give every point a number",
        )
    if len(np.unique(given)) < count:
        raise InputError("two points have the same number", "give every point a number of its own")
    return given.astype(int)
