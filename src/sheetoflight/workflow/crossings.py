"""Pictures of stage crossing: the target, and the laser's spot on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.imaging.crossing import SpotSighting, find_spot
from sheetoflight.imaging.markers import TargetSighting, find_target
from sheetoflight.io.pictures import PictureFile, read_picture
from sheetoflight.io.quoting import file_name
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class Crossing:
    """What one picture of stage crossing, or a pair, shows.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture, px.
    sighting : TargetSighting or None
    spot : SpotSighting or None
        None where the target or the spot was not found.
    reason : str
        What was found, or why there is no spot.
    """

    size: tuple[int, int]
    sighting: TargetSighting | None
    spot: SpotSighting | None
    reason: str

    @property
    def seen(self) -> bool:
        """Whether the picture is of use."""
        return self.spot is not None


def searched_crossing(file: PictureFile, target: CollinearTarget) -> Crossing:
    """Search a picture for the target, and for the spot where the laser's line crosses it.

    Of a pair the target is searched for with the laser off.

    Raises
    ------
    FileError, InputError
        If a picture cannot be used; the message names it.
    """
    picture = read_picture(file.path)
    height, width = picture.shape[:2]
    search = find_target(picture, target)
    if search.sighting is None:
        return Crossing((width, height), None, None, search.reason)
    on, off = picture, None
    if file.laser_on is not None:
        on, off = read_picture(file.laser_on), picture
    try:
        found = find_spot(on, target, search.sighting, off)
    except InputError as error:
        name = file_name(file.laser_on or file.path)
        raise InputError(f"{name}: {error.what}", error.remedy) from error
    return Crossing((width, height), search.sighting, found.spot, found.reason)


def crossing_views(
    names: Sequence[str], lasers: Sequence[int], found: Sequence[Crossing], of_lasers: int
) -> TargetViews:
    """The views in which the spot was found.

    A point's standard uncertainty holds for both its coordinates. A spot is known along the
    target by the line and across it by the markers, so it has the larger of the two.

    Parameters
    ----------
    names, lasers : sequence
        Name of each view, and the number of the laser that is on in it.
    found : sequence of Crossing
    of_lasers : int
        How many lasers the rig has.
    """
    kept, uv, std = [], [], []
    for name, laser, crossing in zip(names, lasers, found, strict=True):
        if crossing.sighting is None or crossing.spot is None:
            continue
        spots, spreads = np.full((of_lasers, 2), np.nan), np.full(of_lasers, np.nan)
        spots[laser] = crossing.spot.uv
        spreads[laser] = max(crossing.spot.std, crossing.spot.across_std)
        kept.append(name)
        uv.append(np.concatenate([crossing.sighting.uv, spots]))
        std.append(np.concatenate([crossing.sighting.std, spreads]))
    return TargetViews(tuple(kept), np.array(uv), np.array(std))
