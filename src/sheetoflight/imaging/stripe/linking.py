"""Chains of neighbouring ridge pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.ridges import Ridges

# A line does not turn by more than this between neighbouring pixels.
_LEAST_COSINE = np.cos(np.radians(40.0))

# How far ahead the next pixel must lie, px: the line's other half is beside, not ahead. At most
# four of the eight neighbours lie so far ahead.
_LEAST_AHEAD, _MOST_AHEAD = 0.3, 4

_AROUND = np.array([(r, d) for r in (-1, 0, 1) for d in (-1, 0, 1) if (r, d) != (0, 0)])


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
    if len(ridges) == 0:
        return []
    neighbours = _neighbours(ridges)
    onwards = _onwards(ridges, neighbours)
    beside = _beside(ridges, neighbours)
    taken = np.zeros(len(ridges), dtype=bool)
    chains = []
    for seed in np.argsort(-ridges.strength, kind="stable").tolist():
        if ridges.strength[seed] < seed_strength:
            break
        if taken[seed]:
            continue
        taken[seed] = True
        forward = _grown(onwards, taken, 2 * seed)
        backward = _grown(onwards, taken, 2 * seed + 1)
        chain = np.array([*backward[::-1], seed, *forward], dtype=np.int64)
        others = beside[chain]
        taken[others[others >= 0]] = True
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


def _neighbours(ridges: Ridges) -> NDArray[np.int64]:
    """The ridge pixel in each direction of `_AROUND`, -1 where there is none: ``(N, 8)``."""
    place = ridges.pixels - ridges.pixels.min(axis=0) + 1
    number = np.full(place.max(axis=0) + 2, -1, dtype=np.int64)
    number[tuple(place.T)] = np.arange(len(place))
    beside = place[:, None] + _AROUND
    return number[beside[..., 0], beside[..., 1]]


def _onwards(ridges: Ridges, neighbours: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where a chain may go, best first: ``(2 N, 4)``.

    A chain passes pixel i along its direction (state ``2 i``) or against it (``2 i + 1``). Each
    state has the states of the neighbours ahead in the order of their costs, -1 for the rest.
    """
    along = ridges.direction
    onwards = np.full((len(along), 2, _MOST_AHEAD), -1, dtype=np.int64)
    turn = np.einsum("nkc,nc->nk", along[neighbours], along)
    step = ridges.uv[neighbours] - ridges.uv[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    cost = np.abs(np.einsum("nkc,nc->nk", step, across)) + 1.0 - np.abs(turn)
    ahead = along @ _AROUND.T
    possible = (neighbours >= 0) & (np.abs(turn) >= _LEAST_COSINE)
    for backward, sign in enumerate((1.0, -1.0)):
        costs = np.where(possible & (sign * ahead >= _LEAST_AHEAD), cost, np.inf)
        order = np.argsort(costs, axis=1, kind="stable")[:, :_MOST_AHEAD]
        states = 2 * neighbours + (sign * turn < 0)
        best = np.take_along_axis(states, order, axis=1)
        usable = np.isfinite(np.take_along_axis(costs, order, axis=1))
        onwards[:, backward] = np.where(usable, best, -1)
    return onwards.reshape(-1, _MOST_AHEAD)


def _grown(onwards: NDArray[np.int64], taken: NDArray[np.bool_], state: int) -> list[int]:
    """The pixels that follow a state, which are taken."""
    chain: list[int] = []
    while True:
        for following in onwards[state].tolist():
            if following < 0:
                return chain
            if not taken[following // 2]:
                break
        else:
            return chain
        state = following
        taken[state // 2] = True
        chain.append(state // 2)


def _beside(ridges: Ridges, neighbours: NDArray[np.int64]) -> NDArray[np.int64]:
    """Neighbours that run along a chain, the same line seen twice: ``(N, 8)``, -1 for none."""
    along = ridges.direction
    turn = np.einsum("nkc,nc->nk", along[neighbours], along)
    return np.where(np.abs(turn) >= _LEAST_COSINE, neighbours, -1)
