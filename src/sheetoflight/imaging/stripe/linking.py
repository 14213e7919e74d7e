"""Chains of neighbouring ridge pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.ridges import Ridges

# A line does not turn by more than this between neighbouring pixels.
_LEAST_COSINE = np.cos(np.radians(40.0))

# How far ahead the next pixel must lie, px: the line's other half is beside, not ahead.
_LEAST_AHEAD = 0.3

_AROUND = [(r, d) for r in (-1, 0, 1) for d in (-1, 0, 1) if (r, d) != (0, 0)]


def linked(ridges: Ridges, seed_strength: float, least_pixels: int) -> list[NDArray[np.int64]]:
    """Chains of ridge pixels, strongest seed first.

    A chain grows from its seed in both directions to the neighbour that continues it best, as
    in Steger 1998, section 2.4, and stops where there is none or it has been taken.

    Parameters
    ----------
    ridges : Ridges
    seed_strength : float
        Strength that at least one pixel of a chain must have, grey levels.
    least_pixels : int
        Shorter chains are dropped.

    Returns
    -------
    list of (M,) int arrays
        Indices into `ridges`, in order along the chain.
    """
    ridges, index = _in_large_groups(ridges, seed_strength, least_pixels)
    by_pixel = {(int(u), int(v)): i for i, (u, v) in enumerate(ridges.pixels)}
    taken = np.zeros(len(ridges), dtype=bool)
    chains = []
    for seed in np.argsort(-ridges.strength, kind="stable"):
        if ridges.strength[seed] < seed_strength:
            break
        if taken[seed]:
            continue
        taken[seed] = True
        forward = _grown(ridges, by_pixel, taken, int(seed), ridges.direction[seed])
        backward = _grown(ridges, by_pixel, taken, int(seed), -ridges.direction[seed])
        chain = np.array([*backward[::-1], int(seed), *forward], dtype=np.int64)
        taken[_beside(ridges, by_pixel, chain)] = True
        if len(chain) >= least_pixels:
            chains.append(index[chain])
    return chains


def _in_large_groups(
    ridges: Ridges, seed_strength: float, least_pixels: int
) -> tuple[Ridges, NDArray[np.int64]]:
    """The ridge pixels that could belong to a chain, and their indices.

    A chain lies within one 8-connected group, which must hold a seed and enough pixels.
    """
    if len(ridges) == 0:
        return ridges, np.empty(0, dtype=np.int64)
    low = ridges.pixels.min(axis=0)
    columns, rows = (ridges.pixels - low).T
    mask = np.zeros((rows.max() + 1, columns.max() + 1), dtype=np.uint8)
    mask[rows, columns] = 1
    count, labels = cv2.connectedComponents(mask, connectivity=8)
    group = np.asarray(labels, np.int64)[rows, columns]
    size = np.bincount(group, minlength=count)
    has_seed = np.bincount(group, ridges.strength >= seed_strength, minlength=count) > 0
    index = np.flatnonzero((size >= least_pixels)[group] & has_seed[group])
    return ridges.taken(index), index


def _grown(
    ridges: Ridges,
    by_pixel: dict[tuple[int, int], int],
    taken: NDArray[np.bool_],
    start: int,
    heading: Array,
) -> list[int]:
    chain: list[int] = []
    here = start
    while True:
        following = _next(ridges, by_pixel, taken, here, heading)
        if following is None:
            return chain
        here, heading = following
        taken[here] = True
        chain.append(here)


def _next(
    ridges: Ridges,
    by_pixel: dict[tuple[int, int], int],
    taken: NDArray[np.bool_],
    here: int,
    heading: Array,
) -> tuple[int, Array] | None:
    """The neighbour ahead that continues the chain best, and the heading there."""
    best, best_cost = None, np.inf
    for other, right, down in _neighbours(ridges, by_pixel, here):
        if taken[other] or right * heading[0] + down * heading[1] < _LEAST_AHEAD:
            continue
        turn = float(ridges.direction[other] @ heading)
        if abs(turn) < _LEAST_COSINE:
            continue
        step = ridges.uv[other] - ridges.uv[here]
        aside = step - float(step @ heading) * heading
        cost = float(np.hypot(aside[0], aside[1])) + 1.0 - abs(turn)
        if cost < best_cost:
            best_cost = cost
            best = (other, ridges.direction[other] * np.sign(turn))
    return best


def _beside(
    ridges: Ridges, by_pixel: dict[tuple[int, int], int], chain: NDArray[np.int64]
) -> list[int]:
    """Neighbours of a chain that run along it: the same line seen twice."""
    return [
        other
        for here in chain
        for other, _, _ in _neighbours(ridges, by_pixel, int(here))
        if abs(float(ridges.direction[other] @ ridges.direction[here])) >= _LEAST_COSINE
    ]


def _neighbours(
    ridges: Ridges, by_pixel: dict[tuple[int, int], int], here: int
) -> list[tuple[int, int, int]]:
    """Ridge pixels next to one, each with its step to the right and down."""
    column, row = (int(c) for c in ridges.pixels[here])
    found = []
    for right, down in _AROUND:
        other = by_pixel.get((column + right, row + down))
        if other is not None:
            found.append((other, right, down))
    return found
