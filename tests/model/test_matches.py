"""Matches refuse what they cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.observations import Observations


def test_half_an_image_point_is_none_and_unknown_std_is_nan() -> None:
    uv = np.zeros((2, 3, 2))
    uv[0, 1, 0] = np.nan
    matches = PointMatches(("a", "b"), uv)
    assert matches.seen.tolist() == [[True, False, True], [True, True, True]]
    assert np.isnan(matches.stds).all()
    assert matches.labels.tolist() == [0, 1, 2]
    assert not matches.without(np.ones((2, 3), dtype=bool)).seen.any()
    assert Observations(matches=matches).counts() == {"match": 2}


def test_what_they_hold_cannot_be_changed() -> None:
    matches = PointMatches(("a",), np.zeros((1, 2, 2)))
    with pytest.raises(ValueError, match="read-only"):
        matches.uv[0, 0, 0] = 1.0


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"names": ("a",)}, "expected \\(1, M, 2\\)"),
        ({"names": ("a", "a")}, "view a is given twice"),
        ({"std": np.zeros((2, 3))}, "not above zero"),
        ({"std": np.ones((2, 2))}, "std has shape"),
        ({"numbers": np.array([0, 1, 1])}, "same number"),
        ({"numbers": np.array([0, 1, -2])}, "whole numbers from 0"),
        ({"numbers": np.array([0, 1])}, "whole numbers from 0"),
    ],
)
def test_other_shapes_are_refused(parts: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        PointMatches(**{"names": ("a", "b"), "uv": np.zeros((2, 3, 2)), **parts})
