"""Which end of the target is marker 0, where one picture cannot tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sheetoflight.imaging.markers.sighting import TargetSighting


def order_by_fixed_end(sightings: Sequence[TargetSighting]) -> list[TargetSighting]:
    """Put the end that all views have in common first.

    For the camera stage, where the target pivots about marker 0: of all the ends seen, marker
    0's image point is the one that some end of every view comes closest to (the median over the
    views counts, so that one odd view does no harm). Sightings that are ordered already are
    returned as they are, and vote with their marker 0 alone. A single view is returned as it is.

    Parameters
    ----------
    sightings : sequence of TargetSighting
        Views of one camera stage.
    """
    if len(sightings) < 2:
        return list(sightings)
    ends = [s.uv[:1] if s.ordered else s.uv[[0, -1]] for s in sightings]
    places = np.concatenate(ends)
    distances = np.stack(
        [np.linalg.norm(places[:, None] - e[None], axis=-1).min(axis=1) for e in ends], axis=-1
    )
    fixed = places[np.lexsort((distances.mean(axis=1), np.median(distances, axis=1)))[0]]
    return [_beginning_at(sighting, fixed) for sighting in sightings]


def _beginning_at(sighting: TargetSighting, fixed: np.ndarray) -> TargetSighting:
    first, last = np.linalg.norm(sighting.uv[[0, -1]] - fixed, axis=-1)
    return sighting.reversed() if not sighting.ordered and last < first else sighting
