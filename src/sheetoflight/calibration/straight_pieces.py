"""Straight pieces of the lines in pictures of boards, and how far each goes on from the pattern.

A line that leaves the board goes on beside it, on the table, a hand, the wall: with a step, or a
bend, or straight. Where enough of it lies on the pattern, it is followed from there; else it is cut
into straight pieces, of which all views together tell which lie on the boards (`line_consensus`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.wrong_points import FALSE_ALARM
from sheetoflight.geometry.directions import Array

_PIECES = 4
"""Pieces of one line that are looked at."""

_TOLERANCE_PX = 2.0
"""Distance from a piece within which points belong to it, before their own scatter is known."""

_SHORT = 10
"""Fewest points of a piece."""

_SHARE = 0.15
"""The same as a part of its line, or of what lies on the pattern: splinters agree with anything."""

_DRAWS = 60

_GROWTH = 0.5
"""By how much of its length a line is followed beyond its end at a time."""

_GROWTH_FACTOR = 4.0
"""Distance from the line at which its continuation ends, in standard deviations of its points."""

_GOES_ON = 0.5
"""Share of the points beyond its end that must lie on the line if it is to go on there."""

_PER_SINGLE = 0.6745
"""Median size of a normal deviation, in standard deviations."""

_MOST = 0.9
"""Share of a line's points that agree where there is one piece only."""

_ROUNDS = 6

_ENOUGH = 200
"""Points that tell a line, roughly, as well as more do."""

_ROUNDING_PX = 1e-4

_BESIDE = 0.1
"""How much a point beside the printed part of a board counts: there may be no board."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A straight piece of a line, in the image free of distortion.

    Parameters
    ----------
    points : (K,) int array
        Numbers of its points.
    ends : (2, 2) array
        Normalised coordinates of its ends.
    weight : float
        How much it counts for a sheet; with 0 it has no say, and may yet lie in it.
    """

    points: np.ndarray
    ends: Array
    weight: float


def cut_into_pieces(
    lines: list[Array],
    focal: float,
    preferred: list[np.ndarray],
    whole: list[np.ndarray | None],
) -> list[list[Piece]]:
    """Cut lines into straight pieces, the one that counts most first.

    Parameters
    ----------
    lines : list of (K, 2) arrays
        Normalised coordinates free of distortion; NaN where there are none.
    focal : float
        px per unit of these.
    preferred : list of (K,) masks
        Points on the printed part of the board.
    whole : list of (K,) masks or None
        For lines that are of one piece its points; see `whole_lines`.
    """
    return [
        _straight_pieces(xy, focal, own, number)
        if points is None
        else [_piece(np.flatnonzero(points), xy, own)]
        for number, (xy, own, points) in enumerate(zip(lines, preferred, whole, strict=True))
    ]


def whole_lines(lines: list[Array], printed: list[np.ndarray]) -> list[np.ndarray | None]:
    """For each line the mask of its points that agree with one straight line, where nearly all
    do, and of those on the printed part of the board too: most lines are of one piece, and all of
    them are looked at together."""
    some = np.zeros((len(lines), _ENOUGH, 2))
    for number, points in enumerate(lines):
        if len(points) >= _SHORT and np.isfinite(points).all():
            some[number] = points[np.linspace(0, len(points) - 1, _ENOUGH).astype(int)]
    weights = np.ones(some.shape[:2])
    middle, normal, scale = (
        np.zeros((len(lines), 2)),
        np.zeros((len(lines), 2)),
        np.zeros(len(lines)),
    )
    for _ in range(_ROUNDS):
        total = weights.sum(axis=1)
        middle = np.einsum("lk,lki->li", weights, some) / total[:, None]
        x, y = np.moveaxis(some - middle[:, None], 2, 0)
        across, along = np.sum(weights * x * y, axis=1), np.sum(weights * (x * x - y * y), axis=1)
        angle = 0.5 * np.arctan2(2.0 * across, along)
        normal = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        off = np.abs(x * normal[:, :1] + y * normal[:, 1:])
        scale = np.maximum(np.median(off, axis=1) / _PER_SINGLE, _ROUNDING_PX)
        weights = 1.0 / (1.0 + (off / (2.0 * scale[:, None])) ** 2)
    found: list[np.ndarray | None] = []
    for points, m, n, s, sure in zip(lines, middle, normal, scale, printed, strict=True):
        off = np.abs(points @ n - m @ n)
        own = off <= s * np.sqrt(float(chdtri(1, FALSE_ALARM / max(len(points), 1))))
        good = len(points) >= _SHORT and own.mean() >= _MOST and off[own].max() <= _TOLERANCE_PX
        good = good and (not sure.any() or own[sure].mean() >= _MOST)
        found.append(own if good else None)
    return found


def _piece(points: np.ndarray, xy: Array, preferred: np.ndarray) -> Piece:
    sure = int(preferred[points].sum())
    weight = min(sure + _BESIDE * (len(points) - sure), _ENOUGH)
    return Piece(points, _ends(xy[points]), float(weight))


def _straight_pieces(xy: Array, focal: float, preferred: np.ndarray, rng_seed: int) -> list[Piece]:
    """The straight pieces of one line."""
    left = np.flatnonzero(np.isfinite(xy).all(axis=1))
    rng = np.random.default_rng(rng_seed)
    pieces: list[Piece] = []
    while len(left) >= _SHORT and len(pieces) < _PIECES:
        points = focal * xy[left]
        own = _most_on_a_line(points, rng)
        if own.sum() >= _SHORT:
            kept = np.flatnonzero(own)
            own[kept[~agreeing(points[own])]] = False
        if own.sum() < _SHORT:
            break
        pieces.append(_piece(left[own], xy, preferred))
        near = np.abs(_off(points, points[own])) <= _TOLERANCE_PX
        left = left[~(own | near)]
    sure = int(preferred.sum())
    long = _SHARE * (sure if sure >= _SHORT else len(xy))
    pieces = [piece for piece in pieces if len(piece.points) >= long]
    return sorted(pieces, key=lambda piece: -piece.weight)


def agreeing(points: Array) -> np.ndarray:
    """Mask of points ``(K, 2)`` px that agree with a straight line, most of them deciding."""
    some = points[:: max(len(points) // _ENOUGH, 1)]
    weights, scale = np.ones(len(some)), np.inf
    for _ in range(_ROUNDS):
        off = np.abs(_off(some, some, weights))
        scale = max(float(np.median(off)) / _PER_SINGLE, _ROUNDING_PX)
        weights = 1.0 / (1.0 + (off / (2.0 * scale)) ** 2)
    limit = np.sqrt(float(chdtri(1, FALSE_ALARM / max(len(points), 1)))) * scale
    return np.abs(_off(points, some, weights)) <= limit


def grown(points: Array, seed: np.ndarray) -> np.ndarray:
    """Mask of the points ``(K, 2)`` px on the straight line of some of them, as far as it goes on
    without a step or a bend.

    What is printed on a board is sure to lie on it, and mostly short; the board's margin carries
    the line on. So the line is followed outwards by half its own length at a time.

    Parameters
    ----------
    points : (K, 2) array
        NaN where there are none.
    seed : (K,) mask
        Points that are sure to lie on the board.
    """
    there = np.isfinite(points).all(axis=1)
    own = seed & there
    own[np.flatnonzero(own)] = agreeing(points[own])
    ended = [False, False]
    while own.any() and not all(ended):
        middle, along = _axis(points[own])
        way = (points - middle) @ along
        off = np.abs((points - middle) @ np.array([-along[1], along[0]]))
        low, high = way[own].min(), way[own].max()
        limit = max(_GROWTH_FACTOR * float(np.median(off[own])) / _PER_SINGLE, _TOLERANCE_PX)
        for side, beyond in enumerate((low - way, way - high)):
            new, ended[side] = _continued(there & (beyond > 0), beyond, off <= limit, high - low)
            own |= new
    return own


def _continued(
    outside: np.ndarray, beyond: Array, near: np.ndarray, length: float
) -> tuple[np.ndarray, bool]:
    """Mask of the points beyond a line's end that carry it on, as far as most of them do and it is
    known to be straight; and whether it ends there."""
    order = np.flatnonzero(outside)
    order = order[np.argsort(beyond[order], kind="stable")]
    new = np.zeros(len(outside), dtype=bool)
    if not len(order) or beyond[order[0]] > length:
        return new, True
    order = order[beyond[order] <= beyond[order[0]] + _GROWTH * length]
    most = np.cumsum(near[order]) > _GOES_ON * np.arange(1, len(order) + 1)
    reached = order[: int(np.flatnonzero(most)[-1]) + 1] if most.any() else order[:0]
    new[reached] = near[reached]
    return new, not most[-1]


def _off(points: Array, line: Array | None = None, weights: Array | None = None) -> Array:
    """Signed distances of points from the total least-squares line of others."""
    line = points if line is None else line
    weights = np.ones(len(line)) if weights is None else weights
    middle = weights @ line / weights.sum()
    x, y = (line - middle).T
    angle = 0.5 * np.arctan2(2.0 * weights @ (x * y), weights @ (x * x - y * y))
    return (points - middle) @ np.array([-np.sin(angle), np.cos(angle)])


def _most_on_a_line(points: Array, rng: np.random.Generator) -> np.ndarray:
    """Mask of the points near the line through two of them that most points are near."""
    first, second = rng.integers(len(points), size=(2, _DRAWS))
    along = points[second] - points[first]
    size = np.linalg.norm(along, axis=1)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(size, 1e-12)[:, None]
    off = np.abs(points @ normal.T - np.sum(points[first] * normal, axis=1))
    near = (off <= _TOLERANCE_PX) & (size > _TOLERANCE_PX)
    return near[:, int(near.sum(axis=0).argmax())]


def _ends(xy: Array) -> Array:
    """The ends ``(2, 2)`` of the piece that points form, on its line."""
    middle, along = _axis(xy)
    way = (xy - middle) @ along
    return middle + np.array([[way.min()], [way.max()]]) * along


def _axis(points: Array) -> tuple[Array, Array]:
    """The middle of points ``(K, 2)``, and the direction of their total least-squares line."""
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    angle = 0.5 * np.arctan2(2.0 * (x @ y), x @ x - y @ y)
    return middle, np.array([np.cos(angle), np.sin(angle)])
