"""What a search for the laser's spot gives, and what it asks for."""

from __future__ import annotations

from dataclasses import dataclass

from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class SpotOptions:
    """What is taken for the laser's spot.

    Parameters
    ----------
    least_significance : float
        The line's summed light in standard deviations of that sum.
    least_amplitude : float
        Its light in standard deviations of a pixel's noise.
    least_angle_deg : float
        Angle between line and target; below it the target lies in the sheet.
    least_length_px : float
        Length of the line that must be seen on plain paper.
    second : float
        Light of a second line over the first's, from which on neither is believed.
    most_rejected : float
        Share of the line's pixels that may differ from those of a straight line.
    most_full : float
        Share of the strip's paper at which the sensor may be full.
    most_std : float
        Largest standard uncertainty of the spot along the target, px.
    most_moved_px : float
        Largest move of the target between the two pictures of a pair.
    """

    least_significance: float = 10.0
    least_amplitude: float = 1.5
    least_angle_deg: float = 10.0
    least_length_px: float = 5.0
    second: float = 0.3
    most_rejected: float = 0.3
    most_full: float = 0.3
    most_std: float = 0.5
    most_moved_px: float = 0.2


@dataclass(frozen=True)
class SpotSighting:
    """The spot as seen in one picture.

    Parameters
    ----------
    uv : (2,) array
        Image point on the target's axis, px; (0, 0) is the centre of the top-left pixel.
    std : float
        Its standard uncertainty along the target, px: from the line's pixels and, where the
        line is oblique, from the markers.
    across_std : float
        Its standard uncertainty across the target, px: that of the axis, which the markers
        alone give.
    angle : float
        Angle between line and target in the picture, 0 to π/2 rad.
    """

    uv: Array
    std: float
    across_std: float
    angle: float

    def __post_init__(self) -> None:
        self.uv.setflags(write=False)


@dataclass(frozen=True)
class SpotSearch:
    """The outcome of a search.

    Parameters
    ----------
    spot : SpotSighting or None
        None where the picture does not show exactly one spot.
    reason : str
        What was found, for a person to read; says why where there is no spot.
    """

    spot: SpotSighting | None
    reason: str


class NoSpotError(Exception):
    """Why there is no spot; never leaves the search."""
