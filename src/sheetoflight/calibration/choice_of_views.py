"""Which views to take: those that make lengths known best, in view of all the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.next_view import (
    NextView,
    most_useful,
    vague_information,
)
from sheetoflight.calibration.plan import (
    Kind,
    Told,
    ViewCounts,
    carried_variances,
    told,
    told_by_many,
)
from sheetoflight.calibration.planned_rig import PlannedRig
from sheetoflight.calibration.predicted_views import PredictedViews
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class LengthScore:
    """How good knowledge of the rig is for lengths all over the field.

    The score is the mean logarithm of the lengths' variances: places that are known well and
    places that are known badly count alike, and image noise that no view takes away is in it.

    Parameters
    ----------
    planned : PlannedRig
    slopes : (F, P) array
        Derivatives of the lengths by the shared parameters.
    image : (F,) array
        Variances of the lengths by the image points of their ends, mm².
    """

    planned: PlannedRig
    slopes: Array
    image: Array

    def __call__(self, information: Array, by_marker: Array) -> Array:
        """Scores ``(N,)`` of N states of knowledge; less is better.

        Parameters
        ----------
        information : (N, P, P) array
            May be singular: the parameters' orders of magnitude count as known.
        by_marker : (N, P, M) array
            As in `Told`.
        """
        vague = vague_information(self.planned.state, self.planned.parameters)
        covariance = np.linalg.inv(information + np.diag(vague))
        variances = carried_variances(self.planned, covariance, by_marker, self.slopes)
        return np.mean(np.log(variances + self.image), axis=1)


def best_sets(
    pool: Mapping[Kind, PredictedViews],
    counts: ViewCounts,
    score: LengthScore,
    most: int,
    progress: Callable[[str, int, int], None],
) -> dict[Kind, np.ndarray]:
    """Views chosen one by one, each the one that betters the score most.

    The stages are chosen in the order camera, crossing, plane; those not chosen yet count as
    so many mean views. The choice in a sheet goes on to `most` views, whose first ones are the
    best of so many.

    Parameters
    ----------
    pool : mapping from kind to PredictedViews
        What there is to choose from; no view is chosen twice.
    counts : ViewCounts
    score : LengthScore
    most : int
    progress : callable
        Called with what is being done, how many parts are done, and how many there are.

    Returns
    -------
    dict from kind to int array
        Views in the order of their choice.
    """
    expected = {kind: told_by_many(views, counts.of(kind)) for kind, views in pool.items()}
    chosen: dict[Kind, np.ndarray] = {}
    for done, stage in enumerate(stages := ("camera", "crossing", "plane")):
        progress("choose", done, len(stages))
        kinds = [kind for kind in pool if kind[0] == stage]
        count = max(counts.plane, most) if stage == "plane" else int(getattr(counts, stage))
        others = [expected[kind] for kind in pool if kind not in kinds]
        orders = _greedy(others, [pool[kind] for kind in kinds], count, score)
        for kind, order in zip(kinds, orders, strict=True):
            chosen[kind] = order
            expected[kind] = told(pool[kind], order[None, : counts.of(kind)])
    progress("choose", len(stages), len(stages))
    return chosen


def _greedy(
    known: Sequence[Told], groups: Sequence[PredictedViews], count: int, score: LengthScore
) -> list[np.ndarray]:
    """The most telling views of each group, in turns."""
    information = sum(one.whole[0] for one in known)
    by_marker = sum(one.by_marker[0] for one in known)
    orders: list[list[int]] = [[] for _ in groups]
    for _ in range(count):
        for views, order in zip(groups, orders, strict=True):
            if len(order) == len(views):
                continue
            scores = score(information + views.information, by_marker + views.by_marker)
            scores[order] = np.inf
            order.append(int(np.argmin(scores)))
            information = information + views.information[order[-1]]
            by_marker = by_marker + views.by_marker[order[-1]]
    return [np.array(order, dtype=int) for order in orders]


def next_for_lengths(
    known: Told, candidates: Sequence[PredictedViews], score: LengthScore
) -> NextView | None:
    """The further view that betters the score most; None where there is none.

    Its gains are shares of the lengths' variance, image noise included, in the geometric mean
    over the field.

    Parameters
    ----------
    known : Told
        One set.
    candidates : sequence of PredictedViews
        Random ones, so that the typical gain is that of an operator's next position.
    score : LengthScore
    """
    now = score(known.whole, known.by_marker)[0]
    gains = [
        1.0 - np.exp(score(known.whole + v.information, known.by_marker + v.by_marker) - now)
        for v in candidates
    ]
    return most_useful(score.planned.rig, candidates, gains)
