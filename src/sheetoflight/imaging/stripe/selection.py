"""Which of several lines is meant where they cross the same row or column."""

from __future__ import annotations

from typing import Literal

import numpy as np

from sheetoflight.model.stripe import Stripe

Which = Literal["all", "brightest", "first", "last"]


def selected(stripe: Stripe, which: Which) -> Stripe:
    """One centre for each row of a steep line, each column of a flat one; or all.

    Parameters
    ----------
    stripe : Stripe
    which : str
        ``all``; the ``brightest`` by its peak; the ``first`` from the left (of flat lines, from
        the top), or the ``last``.
    """
    if which == "all" or len(stripe) == 0:
        return stripe
    steep = np.abs(stripe.across[:, 0]) >= np.abs(stripe.across[:, 1])
    along = 1 if steep.mean() >= 0.5 else 0
    key = np.rint(stripe.uv[:, along]).astype(np.int64)
    across = stripe.uv[:, 1 - along]
    rank = {"brightest": -stripe.peak, "first": across, "last": -across}[which]
    order = np.lexsort((rank, key))
    _, first = np.unique(key[order], return_index=True)
    kept = stripe.taken(np.sort(order[first]))
    _, renumbered = np.unique(kept.line, return_inverse=True)
    return kept.with_lines(renumbered.astype(np.int64))
