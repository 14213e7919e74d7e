"""The older methods with the boards they work on, and what their tests share."""

from __future__ import annotations

import pytest
from scipy.stats import chi2

from sheetoflight.simulation.bodies import folded_body

BOOK = folded_body()
PAIRS = [
    ("planar-lines", None),
    ("planar-lines", BOOK),
    ("cross-ratio", None),
    ("cross-ratio", BOOK),
    ("zigzag", BOOK),
]
EACH = pytest.mark.parametrize(
    ("method", "board"), PAIRS, ids=[f"{m}-{'board' if b is None else 'book'}" for m, b in PAIRS]
)
PINHOLE = (0.0, 0.0, 0.0, 0.0, 0.0)
FALSE_ALARM = 1e-4


def assert_scatter_is_stated(squares: list[float], freedom: int) -> None:
    """The sum is chi-squared: it leaves these limits once in 10 000 times."""
    total, degrees = sum(squares), freedom * len(squares)
    low, high = chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], degrees)
    assert low < total < high, total / degrees
