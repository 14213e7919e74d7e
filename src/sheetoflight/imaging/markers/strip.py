"""The strip between the markers: plain, but for the laser line along it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.grey import GreyPicture


@dataclass(frozen=True)
class StripProfiles:
    """Brightness across the target, in sections between the markers.

    Parameters
    ----------
    centre, along, normal : (2,) array
        A point of the markers' common image line, px, and the unit vectors along and across.
    places : (S,) array
        Middle of each section along the line from `centre`, px.
    across : (K,) array
        Places of the samples across the line, px.
    grey : (S, K) array
        Median of a section's grey values.
    averaged : (S,) array
        Length of each section, px.
    """

    centre: Array
    along: Array
    normal: Array
    places: Array
    across: Array
    grey: Array
    averaged: Array


@dataclass(frozen=True)
class StripOptions:
    """How the strip is read.

    Parameters
    ----------
    sections : int
        About how many sections lie between the first marker and the last.
    clear_of_markers : float
        Distance kept from the markers' centres, in radii.
    width : float
        Half the width that is read, in the smallest marker's radii.
    unlike : float
        Departure from the markers' surround, in the markers' contrasts, that plain paper in
        uneven light does not reach.
    least_plain : float
        Share of the sections that must be plain.
    """

    sections: int = 24
    clear_of_markers: float = 1.4
    width: float = 0.9
    unlike: float = 0.4
    least_plain: float = 0.75


_FINE = 0.5
_SHORTEST_SECTION = 3.0
_BESIDE_LINE = 0.7


def strip_profiles(
    picture: GreyPicture, markers: Sequence[Candidate], options: StripOptions = StripOptions()
) -> StripProfiles:
    """Read the strip between markers given in their order."""
    uv = np.array([m.centre for m in markers])
    centre, along = fitted_line(uv)
    normal = np.array([-along[1], along[0]])
    reach = options.width * min(radius_along(m, normal) for m in markers)
    across = np.arange(-reach, reach + _FINE / 2, _FINE)
    at = (uv - centre) @ along
    places, grey, averaged = [], [], []
    for low, high in _gaps(markers, at, along, options):
        count = round(options.sections * (high - low) / (at[-1] - at[0]))
        count = max(1, min(count, int((high - low) / _SHORTEST_SECTION)))
        edges = np.linspace(low, high, count + 1)
        for start, end in itertools.pairwise(edges):
            a = np.arange(start + 0.5, end)
            grid = centre + a[:, None, None] * along + across[None, :, None] * normal
            places.append((start + end) / 2)
            grey.append(np.median(_read(picture, grid), axis=0))
            averaged.append(end - start)
    shaped = np.array(grey, dtype=float).reshape(-1, len(across))
    return StripProfiles(
        centre, along, normal, np.array(places), across, shaped, np.array(averaged)
    )


def is_plain(
    profiles: StripProfiles,
    markers: Sequence[Candidate],
    options: StripOptions = StripOptions(),
) -> bool:
    """Whether the strip beside the axis looks like the markers' own surround throughout."""
    if not len(profiles.places):
        return True
    at = (np.array([m.centre for m in markers]) - profiles.centre) @ profiles.along
    surround = np.interp(profiles.places, at, [m.surround for m in markers])
    contrast = np.median([abs(m.contrast) for m in markers])
    beside = np.abs(profiles.across) > _BESIDE_LINE * profiles.across[-1]
    departure = np.abs(np.median(profiles.grey[:, beside], axis=1) - surround)
    return bool((departure < options.unlike * contrast).mean() >= options.least_plain)


def radius_along(marker: Candidate, direction: Array) -> float:
    """Distance from a marker's middle to its outline in a direction (unit vector), px."""
    return float(1.0 / np.linalg.norm(np.linalg.solve(marker.frame, direction)))


def _gaps(
    markers: Sequence[Candidate], at: Array, along: Array, options: StripOptions
) -> list[tuple[float, float]]:
    """Stretches of the line between neighbouring markers."""
    room = [options.clear_of_markers * radius_along(m, along) for m in markers]
    gaps = [
        (float(at[k] + room[k]), float(at[k + 1] - room[k + 1])) for k in range(len(markers) - 1)
    ]
    return [(low, high) for low, high in gaps if high - low >= _SHORTEST_SECTION]


def _read(picture: GreyPicture, grid: Array) -> np.ndarray:
    at = grid.astype(np.float32)
    read = cv2.remap(
        picture.values, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(read)
