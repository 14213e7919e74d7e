"""Chains of neighbouring ridge pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.ridges import Ridges

# A line does not turn by more than this between neighbouring pixels.
_LEAST_COSINE = np.cos(np.radians(40.0))

# Neighbours less than this far ahead or behind are beside the pixel: the line's other half.
_BESIDE = 0.3


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
    group = labels[rows, columns]
    size = np.bincount(group, minlength=count)
    has_seed = np.bincount(group, ridges.strength >= seed_strength, minlength=count) > 0
    index = np.flatnonzero((size >= least_pixels)[group] & has_seed[group])
    return ridges.taken(index), index


def _grown(
    ridges: Ridges,
    by_pixel: dict[tuple[int, int], int],
    taken: NDArray[np.bool_],
    start: int,
    heading: NDArray[np.float64],
) -> list[int]:
    chain: list[int] = []
    here = start
    while True:
        following = _next(ridges, by_pixel, taken, here, heading)
        if following is None:
            return chain
        here, heading = following
        chain.append(here)


def _next(
    ridges: Ridges,
    by_pixel: dict[tuple[int, int], int],
    taken: NDArray[np.bool_],
    here: int,
    heading: NDArray[np.float64],
) -> tuple[int, NDArray[np.float64]] | None:
    """The neighbour ahead that continues the chain best; those beside it are used up."""
    column, row = ridges.pixels[here]
    best, best_cost = None, np.inf
    for right in (-1, 0, 1):
        for down in (-1, 0, 1):
            other = by_pixel.get((int(column) + right, int(row) + down))
            if other is None or taken[other]:
                continue
            step = ridges.uv[other] - ridges.uv[here]
            forward = float(step @ heading)
            turn = float(ridges.direction[other] @ heading)
            ahead = right * heading[0] + down * heading[1]
            if abs(turn) < _LEAST_COSINE or ahead < -_BESIDE:
                continue
            taken[other] = True
            if ahead < _BESIDE:
                continue
            cost = float(np.hypot(*(step - forward * heading))) + 1.0 - abs(turn)
            if cost < best_cost:
                best_cost = cost
                best = (other, ridges.direction[other] * np.sign(turn))
    return best
