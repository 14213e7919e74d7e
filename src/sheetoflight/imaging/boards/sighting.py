"""What a search for a board gives."""

from __future__ import annotations

from dataclasses import dataclass

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True, eq=False)
class BoardSighting:
    """A board as seen in one picture.

    Parameters
    ----------
    uv : (M, 2) array
        Image point of each of the board's points in px, in the board's own order; NaN where a
        point was not seen. (0, 0) is the centre of the top-left pixel.
    std : (M,) array
        Standard uncertainty of each image coordinate in px, as the grey values' noise gives it;
        NaN where the point was not seen.

    Raises
    ------
    InputError
        If the shapes disagree.
    """

    uv: Array
    std: Array

    def __post_init__(self) -> None:
        if self.uv.ndim != 2 or self.uv.shape[1] != 2 or self.std.shape != self.uv.shape[:1]:
            raise InputError(
                f"a sighting has uv of shape {self.uv.shape} and std of shape {self.std.shape}",
                "give an image point and a std for each point of the board: (M, 2) and (M,)",
            )
        for array in (self.uv, self.std):
            array.setflags(write=False)


@dataclass(frozen=True, eq=False)
class BoardSearch:
    """The outcome of a search.

    Parameters
    ----------
    sighting : BoardSighting or None
        None where the picture does not show the board well enough.
    reason : str
        What was found, for a person to read; says why, and what to do, where there is no
        sighting.
    """

    sighting: BoardSighting | None
    reason: str


@dataclass(frozen=True, eq=False)
class FoundPoints:
    """A board's points, those that light or dirt disturbs among them.

    Parameters
    ----------
    uv : (M, 2) array
        Image points, px; NaN where not seen.
    std : (M,) array
        Standard uncertainty of each image coordinate, px.
    reach : (M,) array
        Half the side of the window that each point was measured in, px.
    """

    uv: Array
    std: Array
    reach: Array
