"""What was seen of boards: their points, and the line of light across them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.image_points import checked_points, seen_points


def proportions(std: Array) -> tuple[Array, float]:
    """Standard uncertainties over their root mean square, and that: 1 where none is known.

    Parameters
    ----------
    std : array
        NaN where unknown, which counts as typical.
    """
    known = std[np.isfinite(std)]
    typical = float(np.sqrt(np.mean(known**2))) if known.size else 1.0
    return np.where(np.isfinite(std), std, typical) / typical, typical


def _none() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class LinePixels:
    """Points of lines of light on boards, of all views together.

    Parameters
    ----------
    uv : (P, 2) array
        Image points, px.
    std : (P,) array
        Standard uncertainty across the line, px; NaN where unknown.
    view, laser, face : (P,) int array
        Number of the view that each belongs to, of the laser, and of the board's face that it
        shines on.
    place : (P, 2) array, optional
        Where each is in the sheet of light, mm, where a stage tells that; NaN or absent where
        unknown.

    Raises
    ------
    InputError
        If the shapes disagree, a point is not finite, or a place infinite.
    """

    uv: Array = field(default_factory=lambda: np.zeros((0, 2)))
    std: Array = field(default_factory=_none)
    view: np.ndarray = field(default_factory=_none)
    laser: np.ndarray = field(default_factory=_none)
    face: np.ndarray = field(default_factory=_none)
    place: Array | None = None

    def __post_init__(self) -> None:
        count = len(self.uv)
        for name in ("view", "laser", "face"):
            values = np.array(getattr(self, name), dtype=int)
            if values.shape != (count,) or (values < 0).any():
                raise InputError(
                    f"{name} of {count} points of a line has shape {values.shape}, or is negative",
                    "give a number from 0 for each point",
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        uv, std = np.array(self.uv, dtype=float), np.array(self.std, dtype=float)
        if uv.shape != (count, 2) or not np.isfinite(uv).all():
            raise InputError(
                f"a line's points have shape {uv.shape} or are not finite",
                "give u and v of every point",
            )
        if std.shape != (count,) or (std <= 0).any():
            raise InputError(
                f"std of {count} points of a line has shape {std.shape}, or is not above zero",
                "give a std above zero, or NaN, for each point",
            )
        place = np.full((count, 2), np.nan) if self.place is None else np.array(self.place, float)
        if place.shape != (count, 2) or np.isinf(place).any():
            raise InputError(
                f"places of {count} points of a line have shape {place.shape} or are infinite",
                "give two coordinates in the sheet, or NaN, for each point",
            )
        place[np.isnan(place).any(axis=1)] = np.nan
        for name, array in (("uv", uv), ("std", std), ("place", place)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.uv)

    @property
    def places(self) -> Array:
        """``(P, 2)`` places in the sheet, mm; NaN where unknown."""
        assert self.place is not None  # set when the points are made
        return self.place

    @cached_property
    def proportions(self) -> Array:
        """``(P,)``: the points' std, those without one counting as typical, over its root mean
        square."""
        return proportions(self.std)[0]

    def groups(self) -> list[np.ndarray]:
        """Numbers of the points of each line: those of one view, laser and face."""
        if not len(self):
            return []
        key = (self.view * (self.laser.max() + 1) + self.laser) * (self.face.max() + 1) + self.face
        order = np.argsort(key, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(key[order])) + 1)

    def take(self, points: np.ndarray) -> LinePixels:
        """The points that an index array or mask selects."""
        return LinePixels(
            self.uv[points],
            self.std[points],
            self.view[points],
            self.laser[points],
            self.face[points],
            self.places[points],
        )


@dataclass(frozen=True, eq=False)
class BoardViews:
    """Image points of a board in the views of stage board.

    Parameters
    ----------
    names : tuple of str
        A name for each of the N views, unique in the stage.
    uv : (N, M, 2) array
        Image point of each of the board's M points in px; NaN where it was not seen.
    std : (N, M) array, optional
        Standard uncertainty of each image coordinate in px; NaN or absent where unknown.
    line : LinePixels
        The line of light on the boards; views without a line are of use for the camera.

    Raises
    ------
    InputError
        If shapes disagree, a name is not unique, or a line belongs to no view.
    """

    names: tuple[str, ...] = ()
    uv: Array = field(default_factory=lambda: np.zeros((0, 0, 2)))
    std: Array | None = None
    line: LinePixels = field(default_factory=LinePixels)

    def __post_init__(self) -> None:
        uv, std = checked_points(self.names, self.uv, self.std)
        if len(self.line) and int(self.line.view.max()) >= len(self.names):
            raise InputError(
                f"a line belongs to view {int(self.line.view.max())} of {len(self.names)}",
                "count the views from 0",
            )
        for name, array in (("uv", uv), ("std", std)):
            object.__setattr__(self, name, array)
        object.__setattr__(self, "names", tuple(self.names))

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def seen(self) -> np.ndarray:
        """``(N, M)`` mask of the points that were seen."""
        return seen_points(self.uv)

    def take(self, views: np.ndarray) -> BoardViews:
        """The views that an index array or mask selects, their lines with them."""
        index = np.arange(len(self))[views]
        place = np.full(len(self), -1)
        place[index] = np.arange(len(index))
        kept = self.line.take(place[self.line.view] >= 0)
        line = replace(kept, view=place[kept.view])
        names = tuple(self.names[i] for i in index)
        return BoardViews(names, self.uv[index], self.stds[index], line)

    @property
    def stds(self) -> Array:
        """``(N, M)`` std of the points, NaN where unknown."""
        assert self.std is not None  # set when the views are made
        return self.std

    def without(self, points: np.ndarray, line_points: np.ndarray | None = None) -> BoardViews:
        """The views with the points of a mask ``(N, M)``, and those of the line of a mask
        ``(P,)``, taken as not seen."""
        line = self.line if line_points is None else self.line.take(~line_points)
        return replace(self, uv=np.where(points[..., None], np.nan, self.uv), line=line)
