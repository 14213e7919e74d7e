"""Which candidates are the target: markers on one line whose sizes foretell their distances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.projective_line import foretold_points
from sheetoflight.imaging.markers.strip import radius_along
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class IdentifyOptions:
    """How closely candidates must agree to be one target.

    Parameters
    ----------
    distance : float
        Largest departure of a distance from that foretold by the markers' sizes, as a share.
    off_line, along_line : float
        Largest departure of a middle marker from its foretold place, across and along the
        target, as a share of the target's image; lens distortion bends it by a little.
    room_px : float
        Room added to both, for the coarse place of a candidate.
    quarter_rad : float
        Largest angle between the target's line and the quarters that should lie along it.
    size : float
        Largest departure of a middle marker's size, as a share.
    """

    distance: float = 0.35
    off_line: float = 0.02
    along_line: float = 0.1
    room_px: float = 2.0
    quarter_rad: float = 0.35
    size: float = 0.5


COARSE = IdentifyOptions()
"""For candidates as they are first seen; sizes are rough, above all under the laser line."""

FINE = IdentifyOptions(0.08, 0.015, 0.02, 0.5, 0.1, 0.12)
"""For measured markers; lens distortion and uneven paper leave them not quite projective."""


@dataclass(frozen=True)
class Match:
    """Candidates that together look like the target.

    Parameters
    ----------
    members : tuple of int
        Index of the candidate for each marker, in the markers' order.
    misfit : float
        Departure from what is foretold; 0 is perfect, 1 the limit.
    """

    members: tuple[int, ...]
    misfit: float


def matches(
    candidates: Sequence[Candidate],
    target: CollinearTarget,
    options: IdentifyOptions = COARSE,
) -> list[Match]:
    """All ways in which candidates make up the whole target, best first."""
    if len(candidates) < len(target.markers_mm):
        return []
    field = _Field(candidates, target, options)
    found = [m for pair in field.end_pairs() if (m := field.completed(*pair)) is not None]
    return sorted(found, key=lambda match: match.misfit)


def largest_part(
    candidates: Sequence[Candidate],
    target: CollinearTarget,
    options: IdentifyOptions = COARSE,
) -> tuple[int, ...]:
    """The most candidates that could be markers of one target, where it is not complete."""
    if not candidates:
        return ()
    field = _Field(candidates, target, options)
    best: tuple[int, ...] = ()
    for first, second, i, j in field.pairs():
        part = field.part(first, second, i, j)
        if len(part) > len(best):
            best = part
    return best


class _Field:
    """The candidates of one picture, with what every pair of them foretells."""

    def __init__(
        self, candidates: Sequence[Candidate], target: CollinearTarget, options: IdentifyOptions
    ) -> None:
        self.options = options
        self.positions = target.positions
        self.quadrant = target.marker == "quadrant"
        self.size = target.marker_size_mm
        self.centres = np.array([c.centre for c in candidates])
        self.frames = np.array([c.frame for c in candidates])
        self.dark = np.array([c.contrast > 0 for c in candidates])
        offsets = self.centres[None, :, :] - self.centres[:, None, :]
        self.distances = np.linalg.norm(offsets, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            self.directions = offsets / self.distances[..., None]
        np.nan_to_num(self.directions, copy=False)
        # scales[i, j]: px per mm at candidate i along the line to candidate j.
        inner = np.einsum("iab,ijb->ija", np.linalg.inv(self.frames), self.directions)
        with np.errstate(divide="ignore"):
            self.scales = 2.0 / (self.size * np.linalg.norm(inner, axis=-1))
        self.foretold = np.sqrt(self.scales * self.scales.T)
        self.black_along = self._along([1.0, 1.0])
        self.white_along = self._along([1.0, -1.0])

    def _along(self, diagonal: list[float]) -> np.ndarray:
        """Mask (N, N): the quarters of candidate i lie along its line to candidate j."""
        if not self.quadrant:
            return np.ones(self.distances.shape, bool)
        axis = self.frames @ np.array(diagonal)
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        cosine = np.abs(np.einsum("ia,ija->ij", axis, self.directions))
        return cosine > np.cos(self.options.quarter_rad)

    def _misfits(self, length_mm: float) -> Array:
        """Departure (N, N) of each distance from ``length_mm`` as foretold, 1 at the limit."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.distances / (length_mm * self.foretold)
            misfit = np.abs(np.log(ratio)) / np.log1p(self.options.distance)
        return np.where(np.isfinite(misfit), misfit, np.inf)

    def _allowed(self, first: int, second: int) -> np.ndarray:
        """Mask (N, N) of pairs that may be markers ``first`` and ``second``."""
        at_first = self.black_along if first == 0 else self.white_along
        at_second = self.black_along if second == 0 else self.white_along
        allowed = at_first & at_second.T & (self.dark[:, None] == self.dark[None, :])
        length = float(self.positions[second] - self.positions[first])
        return allowed & (self._misfits(length) < 1.0)

    def end_pairs(self) -> Iterator[tuple[int, int, float]]:
        """Candidates that may be the first and last marker, with their misfit."""
        misfits = self._misfits(float(self.positions[-1]))
        for i, j in np.argwhere(self._allowed(0, len(self.positions) - 1)):
            yield int(i), int(j), float(misfits[i, j])

    def pairs(self) -> Iterator[tuple[int, int, int, int]]:
        """Every two markers, and candidates that may be they."""
        count = len(self.positions)
        for first in range(count):
            for second in range(first + 1, count):
                for i, j in np.argwhere(self._allowed(first, second)):
                    yield first, second, int(i), int(j)

    def completed(self, i: int, j: int, misfit: float) -> Match | None:
        """The match whose ends are candidates i and j, if every marker between is there."""
        ends, scales = self.centres[[i, j]], np.array([self.scales[i, j], self.scales[j, i]])
        fractions = self.positions[1:-1] / self.positions[-1]
        places = foretold_points(ends, scales, fractions)
        members = [i]
        for place, fraction in zip(places, fractions, strict=True):
            member, error = self._nearest(place, float(fraction), i, j)
            if member is None or member in members:
                return None
            members.append(member)
            misfit = max(misfit, error)
        return Match((*members, j), misfit)

    def _nearest(self, place: Array, fraction: float, i: int, j: int) -> tuple[int | None, float]:
        """The candidate at a foretold place between i and j, and its misfit."""
        options, direction = self.options, self.directions[i, j]
        offset = self.centres - place
        along = np.abs(offset @ direction)
        across = np.abs(offset @ [-direction[1], direction[0]])
        length = self.distances[i, j]
        error = np.hypot(
            along / (options.along_line * length + options.room_px),
            across / (options.off_line * length + options.room_px),
        )
        roots = 1 / np.sqrt([self.scales[i, j], self.scales[j, i]])
        scale = 1.0 / (roots[0] + fraction * (roots[1] - roots[0])) ** 2
        with np.errstate(divide="ignore"):
            size = np.abs(np.log(self.scales[:, i] / scale)) / np.log1p(options.size)
        error = np.maximum(error, size)
        error[~(self.white_along[:, i] & (self.dark == self.dark[i]))] = np.inf
        error[[i, j]] = np.inf
        best = int(error.argmin())
        return (best, float(error[best])) if error[best] < 1.0 else (None, np.inf)

    def part(self, first: int, second: int, i: int, j: int) -> tuple[int, ...]:
        """Candidates i and j as two markers, and those at the places between them."""
        t = self.positions
        members = [i]
        scales = np.array([self.scales[i, j], self.scales[j, i]])
        for between in range(first + 1, second):
            fraction = (t[between] - t[first]) / (t[second] - t[first])
            place = foretold_points(self.centres[[i, j]], scales, np.array([fraction]))[0]
            member, _ = self._nearest(place, float(fraction), i, j)
            if member is not None:
                members.append(member)
        return (*members, j)


def spacing_error(markers: Sequence[Candidate], positions: Array) -> float:
    """Departure of the middle markers from where the sizes of the end markers foretell them.

    The largest distance along the target as a share of its image's length. Unlike the spacing
    alone, of which three markers leave every order possible, it tells the two ends apart where
    the positions are not symmetric.
    """
    ends = np.array([markers[0].centre, markers[-1].centre])
    length = float(np.linalg.norm(ends[1] - ends[0]))
    direction = (ends[1] - ends[0]) / length
    scales = np.array([radius_along(m, direction) for m in (markers[0], markers[-1])])
    places = foretold_points(ends, scales, positions[1:-1] / positions[-1])
    middles = np.array([m.centre for m in markers[1:-1]])
    return float(np.abs((middles - places) @ direction).max()) / length
