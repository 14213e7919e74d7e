"""Chains joined across short gaps where one goes on in the direction of the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.ridges import Ridges

_CHORD_PIXELS = 12
_GAP_PX, _GAP_SCALES = 8.0, 4.0
_LEAST_COSINE = np.cos(np.radians(25.0))
_ASIDE_PX, _ASIDE_OF_GAP = 1.5, 0.3


def bridged(ridges: Ridges, chains: list[NDArray[np.int64]]) -> list[NDArray[np.int64]]:
    """Chains that go on in each other's direction joined into one, nearest ends first.

    Noise breaks the chain of a faint line. Whether a gap is dark is not judged here but by the
    centres in it.

    Parameters
    ----------
    ridges : Ridges
    chains : list of (M,) int arrays
        Indices into `ridges`, in order along each chain.
    """
    chains = list(chains)
    while (pair := _nearest_pair(ridges, chains)) is not None:
        first, second = pair
        forward = chains[first // 2] if first % 2 else chains[first // 2][::-1]
        onward = chains[second // 2][::-1] if second % 2 else chains[second // 2]
        kept = [c for i, c in enumerate(chains) if i not in (first // 2, second // 2)]
        chains = [np.concatenate([forward, onward]), *kept]
    return chains


def _nearest_pair(ridges: Ridges, chains: list[NDArray[np.int64]]) -> tuple[int, int] | None:
    """Two ends that can be joined; end ``2 i`` is the beginning of chain i, ``2 i + 1`` its end."""
    if len(chains) < 2:
        return None
    points, outwards = _ends(ridges, chains)
    offset = points[None] - points[:, None]
    gap = np.linalg.norm(offset, axis=-1)
    ahead = np.einsum("ijk,ik->ij", offset, outwards)
    aside = np.sqrt(np.maximum(gap**2 - ahead**2, 0.0))
    joinable = (gap <= _GAP_PX + _GAP_SCALES * ridges.scale) & (ahead > 0.0) & (ahead.T > 0.0)
    joinable &= outwards @ outwards.T <= -_LEAST_COSINE
    joinable &= np.maximum(aside, aside.T) <= _ASIDE_PX + _ASIDE_OF_GAP * gap
    chain = np.arange(len(points)) // 2
    joinable &= chain[:, None] != chain
    if not joinable.any():
        return None
    first, second = np.unravel_index(np.argmin(np.where(joinable, gap, np.inf)), gap.shape)
    return int(first), int(second)


def _ends(ridges: Ridges, chains: list[NDArray[np.int64]]) -> tuple[Array, Array]:
    """Points ``(2 C, 2)`` and unit directions outwards of both ends of each chain."""
    points, outwards = [], []
    for chain in chains:
        uv = ridges.uv[chain]
        inner = min(_CHORD_PIXELS, len(uv) - 1)
        for end, inside in ((uv[0], uv[inner]), (uv[-1], uv[-1 - inner])):
            points.append(end)
            outwards.append((end - inside) / max(float(np.linalg.norm(end - inside)), 1e-9))
    return np.array(points), np.array(outwards)
