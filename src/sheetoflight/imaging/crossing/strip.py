"""The target's strip as one picture, or a pair, shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.crossing.axis import TargetAxis, target_axis
from sheetoflight.imaging.crossing.band import Band, ground, paper, target_band
from sheetoflight.imaging.crossing.fit import Pixels
from sheetoflight.imaging.crossing.search import RoughLine
from sheetoflight.imaging.markers.grey import grey_picture
from sheetoflight.imaging.markers.sighting import TargetSighting
from sheetoflight.imaging.stripe.colour import laser_light
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.model.target import CollinearTarget

_LEAST_ROW = 0.5  # of the longest


@dataclass(frozen=True)
class Strip:
    """The strip, its paper and the light on it.

    Parameters
    ----------
    band : Band
        Places along and across the target.
    paper : (K, S) bool array
        Where there is plain paper.
    light : LineLight
        The picture's light, the background removed where there is a pair.
    laser : (K, S) array
        The light in the band, less what the bare strip shows and what runs along it.
    along : (K,) array
        What runs along the strip: the light that all of a row shows; NaN where it shows
        little paper.
    """

    band: Band
    paper: NDArray[np.bool_]
    light: LineLight
    laser: Array
    along: Array

    @property
    def axis(self) -> TargetAxis:
        """The target's axis."""
        return self.band.axis

    def pixels(self, line: RoughLine, reach: float) -> Pixels:
        """The picture's own pixels on plain paper within a distance of a line, px."""
        corners = self.axis.uv(self.band.a[[0, 0, -1, -1]], self.band.n[[0, -1, 0, -1]])
        height, width = self.light.picture.shape
        low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, [width, height])
        u, v = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        a, n = self.axis.coordinates(np.stack([u, v], axis=-1))
        near = np.abs(line.distance(a, n)) < reach
        near[near] = self.band.at(self.paper, a[near], n[near])
        u, v = u[near], v[near]
        return Pixels(
            a[near], n[near], self.light.picture[v, u].astype(float), self.light.full[v, u]
        )


def strip_seen(
    picture: NDArray[Any],
    target: CollinearTarget,
    sighting: TargetSighting,
    picture_off: NDArray[Any] | None,
) -> Strip:
    """Read the strip of a sighted target; arguments as in `find_spot`."""
    light = laser_light(picture, picture_off)
    band = target_band(target_axis(target, sighting), light.picture.shape)
    bare = grey_picture(picture if picture_off is None else picture_off)
    plain = paper(band, band.read(bare.values), target.marker)
    shown = band.read(light.picture)
    laser = shown - ground(band, shown)
    along = _medians(laser, plain)
    return Strip(band, plain, light, laser - np.nan_to_num(along)[:, None], along)


def _medians(light: Array, plain: NDArray[np.bool_]) -> Array:
    """Median ``(K,)`` of each row's paper; NaN for a row with too little, which a line may fill."""
    medians, length = np.full(len(light), np.nan), plain.sum(axis=1)
    used = length > _LEAST_ROW * length.max(initial=1)
    shown = np.where(plain[used], light[used], np.nan)
    medians[used] = np.nanmedian(shown, axis=1)
    return medians
