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
        Largest departure of a distance from that foretold by two markers' sizes, as a share.
    along, across : float
        Largest departure of a further marker from its foretold place along and across the
        target, as a share of the distance of the two that foretell it.
    room_px : float
        Room added to both, for the coarse place of a candidate.
    quarter_rad : float
        Largest angle between the target's line and the quarters that should lie along it.
    size : float
        Largest departure of a further marker's size from the foretold, as a share.
    shapes : bool
        Whether quarters and sizes of the further markers must agree as well; without, a
        candidate at the right place is enough.
    most_pairs : int
        How many pairs are followed up, best first; a wall of equal discs has very many.
    """

    distance: float = 0.35
    along: float = 0.2
    across: float = 0.02
    room_px: float = 2.0
    quarter_rad: float = 0.35
    size: float = 0.5
    shapes: bool = False
    most_pairs: int = 1000


COARSE = IdentifyOptions()
"""For candidates as they are first seen. Under the laser line a marker's shape is distorted: two
that are seen well foretell where the others are and how they look."""

FINE = IdentifyOptions(0.12, 0.08, 0.015, 0.5, 0.15, 0.2, shapes=True)
"""For measured markers; lens distortion and uneven paper leave them not quite projective."""


@dataclass(frozen=True)
class Match:
    """Candidates that together look like the target.

    Parameters
    ----------
    members : tuple of int
        Index of the candidate for each marker, in the markers' order.
    markers : tuple of Candidate
        The markers, each in the shape that the best seen ones foretell.
    misfit : float
        Departure from what is foretold; up to 1 where all agrees within the limits.
    """

    members: tuple[int, ...]
    markers: tuple[Candidate, ...]
    misfit: float


@dataclass(frozen=True)
class _Pair:
    """Candidates ``i`` and ``j`` as the markers ``first`` and ``second``."""

    first: int
    second: int
    i: int
    j: int
    misfit: float


def matches(
    candidates: Sequence[Candidate], target: CollinearTarget, options: IdentifyOptions = COARSE
) -> list[Match]:
    """All ways in which candidates make up the whole target, best first."""
    if len(candidates) < len(target.markers_mm):
        return []
    field = _Field(candidates, target, options)
    best: dict[tuple[int, ...], Match] = {}
    for pair in field.pairs():
        for match in field.completed(pair):
            known = best.get(match.members)
            if known is None or match.misfit < known.misfit:
                best[match.members] = match
    return sorted(best.values(), key=lambda match: match.misfit)


def largest_part(candidates: Sequence[Candidate], target: CollinearTarget) -> tuple[int, ...]:
    """The most candidates that could be markers of one target, where it is not complete."""
    if not candidates:
        return ()
    field = _Field(candidates, target, COARSE)
    best: tuple[int, ...] = ()
    for pair in field.pairs():
        places = [field.at_place(pair, k) for k in field.others(pair)]
        part = {pair.i, pair.j, *(near[0][0] for near in places if near)}
        if len(part) > len(best):
            best = tuple(sorted(part))
    return best


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


_PLACES_TRIED = 3


class _Field:
    """The candidates of one picture, with what every two of them foretell."""

    def __init__(
        self, candidates: Sequence[Candidate], target: CollinearTarget, options: IdentifyOptions
    ) -> None:
        self._candidates, self._options = candidates, options
        self._positions = target.positions
        self._quadrant = target.marker == "quadrant"
        self._centres = np.array([c.centre for c in candidates])
        self._frames = np.array([c.frame for c in candidates])
        self._dark = np.array([c.contrast > 0 for c in candidates])
        offsets = self._centres[None, :, :] - self._centres[:, None, :]
        self._distances = np.linalg.norm(offsets, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            self._directions = offsets / self._distances[..., None]
        np.nan_to_num(self._directions, copy=False)
        # _scales[i, j]: px per mm at candidate i along the line to candidate j.
        inner = np.einsum("iab,ijb->ija", np.linalg.inv(self._frames), self._directions)
        with np.errstate(divide="ignore"):
            self._scales = 2.0 / (target.marker_size_mm * np.linalg.norm(inner, axis=-1))
        self._black_along = self._along([1.0, 1.0])
        self._white_along = self._along([1.0, -1.0])

    def pairs(self) -> list[_Pair]:
        """Every two markers, and candidates that may be they, best first."""
        found: list[_Pair] = []
        count = len(self._positions)
        for first in range(count):
            for second in range(first + 1, count):
                misfits = self._misfits(first, second)
                found += [
                    _Pair(first, second, int(i), int(j), float(misfits[i, j]))
                    for i, j in np.argwhere(misfits < 1.0)
                ]
        return sorted(found, key=lambda pair: pair.misfit)[: self._options.most_pairs]

    def others(self, pair: _Pair) -> list[int]:
        """The markers that a pair leaves to be found."""
        return [k for k in range(len(self._positions)) if k not in (pair.first, pair.second)]

    def completed(self, pair: _Pair) -> Iterator[Match]:
        """The targets that a pair and candidates at the foretold places make up."""
        chosen: list[tuple[dict[int, int], float]] = [
            ({pair.first: pair.i, pair.second: pair.j}, pair.misfit)
        ]
        for k in self.others(pair):
            near = self.at_place(pair, k)
            chosen = [
                ({**members, k: index}, max(misfit, error))
                for members, misfit in chosen
                for index, error in near
                if index not in members.values()
            ]
        for members, misfit in chosen:
            order = tuple(members[k] for k in range(len(self._positions)))
            yield Match(order, self._foretold_markers(pair, order), misfit)

    def at_place(self, pair: _Pair, k: int) -> list[tuple[int, float]]:
        """Candidates where the pair foretells marker ``k``, nearest first, with their misfit."""
        options, direction = self._options, self._directions[pair.i, pair.j]
        fraction, scale = self._foretold_scale(pair, k)
        if scale is None:
            return []
        ends = self._centres[[pair.i, pair.j]]
        place = foretold_points(ends, self._pair_scales(pair), np.array([fraction]))[0]
        offset = self._centres - place
        distance = self._distances[pair.i, pair.j]
        # An error of the pair's scales moves places by f(1 − f): most beyond the pair.
        lever = abs(fraction * (1.0 - fraction))
        along = np.abs(offset @ direction) / (options.along * lever * distance + options.room_px)
        across = np.abs(offset @ [-direction[1], direction[0]])
        across /= options.across * max(1.0, abs(fraction)) * distance + options.room_px
        error = np.hypot(along, across)
        unlike = self._unlike(pair, k, scale)
        error = np.where(unlike, np.inf if options.shapes else error + 1.0, error)
        error[[pair.i, pair.j]] = np.inf
        order = np.argsort(error, kind="stable")[:_PLACES_TRIED]
        limit = 1.0 + unlike
        return [(int(n), float(error[n])) for n in order if error[n] < limit[n]]

    def _along(self, diagonal: list[float]) -> np.ndarray:
        """Mask (N, N): the quarters of candidate i lie along its line to candidate j."""
        if not self._quadrant:
            return np.ones(self._distances.shape, bool)
        axis = self._frames @ np.array(diagonal)
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        cosine = np.abs(np.einsum("ia,ija->ij", axis, self._directions))
        return cosine > np.cos(self._options.quarter_rad)

    def _quarters_for(self, k: int) -> np.ndarray:
        return self._black_along if k == 0 else self._white_along

    def _misfits(self, first: int, second: int) -> Array:
        """Misfit (N, N) of candidates i, j as two markers; inf where they cannot be they."""
        length = float(self._positions[second] - self._positions[first])
        foretold = length * np.sqrt(self._scales * self._scales.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            misfit = np.abs(np.log(self._distances / foretold)) / np.log1p(self._options.distance)
        allowed = self._quarters_for(first) & self._quarters_for(second).T
        allowed &= (self._dark[:, None] == self._dark[None, :]) & np.isfinite(misfit)
        return np.where(allowed, misfit, np.inf)

    def _pair_scales(self, pair: _Pair) -> Array:
        return np.array([self._scales[pair.i, pair.j], self._scales[pair.j, pair.i]])

    def _foretold_scale(self, pair: _Pair, k: int) -> tuple[float, float | None]:
        """Where marker k lies as a fraction of the pair's distance, and its scale; None where
        the pair's perspective does not reach so far."""
        t = self._positions
        fraction = float((t[k] - t[pair.first]) / (t[pair.second] - t[pair.first]))
        roots = 1.0 / np.sqrt(self._pair_scales(pair))
        root = float(roots[0] + fraction * (roots[1] - roots[0]))
        return fraction, (1.0 / root**2 if root > 0.2 * roots.min() else None)

    def _unlike(self, pair: _Pair, k: int, scale: float) -> np.ndarray:
        """Mask (N,) of candidates that do not look as marker k should."""
        scales, quarters = self._scales[:, pair.i], self._quarters_for(k)[:, pair.i]
        with np.errstate(divide="ignore"):
            size = np.abs(np.log(scales / scale)) / np.log1p(self._options.size)
        return (size > 1.0) | ~quarters | (self._dark != self._dark[pair.i])

    def _foretold_markers(self, pair: _Pair, members: tuple[int, ...]) -> tuple[Candidate, ...]:
        """The members, those outside the pair in the shape that the pair foretells."""
        markers = []
        for k, member in enumerate(members):
            candidate = self._candidates[member]
            if member not in (pair.i, pair.j):
                frame = self._foretold_frame(pair, k)
                like = self._candidates[pair.i]
                candidate = Candidate(candidate.centre, frame, like.contrast, like.surround)
            markers.append(candidate)
        return tuple(markers)

    def _foretold_frame(self, pair: _Pair, k: int) -> Array:
        """The pair's nearer marker, moved along the target to the place of marker k.

        Lengths along the target grow with its local scale, lengths across with the root of it.
        """
        t = self._positions
        nearer_first = abs(t[k] - t[pair.first]) < abs(t[k] - t[pair.second])
        near, far = (pair.i, pair.j) if nearer_first else (pair.j, pair.i)
        frame, direction = self._frames[near], self._directions[near, far]
        unit = np.linalg.solve(frame, direction)
        unit /= np.linalg.norm(unit)
        _, scale = self._foretold_scale(pair, k)
        growth = (scale or self._scales[near, far]) / self._scales[near, far]
        along = frame @ unit * growth
        across = frame @ [-unit[1], unit[0]] * np.sqrt(growth)
        sign = 1.0 if k == 0 else -1.0
        return np.stack([along + across, sign * (along - across)], axis=-1) / np.sqrt(2.0)
