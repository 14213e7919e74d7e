"""Which end is marker 0, where the views must tell together."""

from __future__ import annotations

import numpy as np

from sheetoflight.imaging.markers import TargetSighting, order_by_fixed_end


def sighting(first: tuple[float, float], last: tuple[float, float], ordered: bool = False):
    uv = np.linspace(first, last, 3)
    return TargetSighting(uv, np.full(3, 0.01), ordered, 0.99, np.array([10.0, 11.0, 12.0]))


ANCHOR = (300.0, 200.0)
ENDS = [(500.0, 250.0), (120.0, 400.0), (310.0, 600.0), (40.0, 90.0)]


def test_the_common_end_comes_first() -> None:
    views = [
        sighting(ANCHOR, end) if i % 2 else sighting(end, ANCHOR) for i, end in enumerate(ENDS)
    ]
    for view, end in zip(order_by_fixed_end(views), ENDS, strict=True):
        assert np.array_equal(view.uv[[0, -1]], [ANCHOR, end])


def test_diameters_and_uncertainties_turn_with_the_points() -> None:
    views = [sighting(ENDS[0], ANCHOR), sighting(ANCHOR, ENDS[1])]
    assert order_by_fixed_end(views)[0].diameter.tolist() == [12.0, 11.0, 10.0]


def test_an_odd_view_does_no_harm() -> None:
    views = [sighting(end, ANCHOR) for end in ENDS] + [sighting((900.0, 900.0), (950.0, 700.0))]
    ordered = order_by_fixed_end(views)
    assert all(np.array_equal(view.uv[0], ANCHOR) for view in ordered[:-1])


def test_what_is_ordered_stays() -> None:
    views = [sighting(ENDS[0], ANCHOR, ordered=True), sighting(ENDS[1], ANCHOR)]
    assert np.array_equal(order_by_fixed_end(views)[0].uv, views[0].uv)


def test_one_view_or_none_stay_as_they_are() -> None:
    assert order_by_fixed_end([]) == []
    single = sighting(ENDS[0], ANCHOR)
    assert order_by_fixed_end([single]) == [single]
