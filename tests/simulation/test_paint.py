"""Painted shapes cover their area, wherever they fall on the sampling grid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sheetoflight.simulation.paint import Block, Cells, Chart, Checker, Disc, Quadrants

PITCH = 0.25
TURN = 0.37
CODE = ((True, True, False), (False, True, True), (False, False, True))


def chart(turn: float = TURN, shift: tuple[float, float] = (0.113, 0.071)) -> Chart:
    """A surface seen squarely, turned in the picture; samples `PITCH` px and mm apart."""
    u, v = np.meshgrid(*(np.arange(-15.0, 15.0, PITCH) + s for s in shift))
    cos, sin = math.cos(turn), math.sin(turn)
    return Chart(
        a=cos * u + sin * v,
        b=cos * v - sin * u,
        a_per_px=(np.array(cos), np.array(sin)),
        b_per_px=(np.array(-sin), np.array(cos)),
        footprint_px=PITCH,
    )


def area(coverage: np.ndarray) -> float:
    """Covered area in mm²."""
    return float(coverage.sum()) * PITCH**2


def corner_bound(corners: int, radius: float = np.inf, perimeter: float = 0.0) -> float:
    """Largest error of an area: a quarter of the cell at each corner or crossing of two edges,
    and along a curved edge the sliver of ``PITCH²/(8 radius)`` between chord and arc."""
    return corners * PITCH**2 / 4 + perimeter * PITCH**2 / (8 * radius)


def test_axis_parallel_block_covers_its_area_exactly():
    """Without turning, the ramp is the footprint's own share: only rounding is left."""
    for width in (7.13, 1.0, 0.03):
        block = Block(0.31, -0.17, 4.2, width / 2, 1.0)
        assert area(block.coverage(chart(turn=0.0))) == pytest.approx(8.4 * width, rel=1e-12)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.113, 0.071), (0.2, 0.05)], ids=str)
def test_turned_shapes_cover_their_area(shift):
    """A disc, its quarters, a block, chequers of odd and of oblong size, and a coded patch."""
    c = chart(shift=shift)
    radius = 6.3
    disc = math.pi * radius**2
    rim = 2 * math.pi * radius
    cases = [
        (Disc(0.4, 0.3, radius, 0.1), disc, corner_bound(0, radius, rim)),
        (Quadrants(0.4, 0.3, radius, 0.1, along=True), disc / 2, corner_bound(5, radius, rim / 2)),
        (Quadrants(0.4, 0.3, radius, 0.1, along=False), disc / 2, corner_bound(5, radius, rim / 2)),
        (Block(0.4, 0.3, 5.0, 2.0, 0.1, turn=0.5), 40.0, corner_bound(4)),
        (Checker(0.4, 0.3, (3.0, 3.0), (5, 5), 0.1), 13 * 9.0, corner_bound(36)),
        (Checker(0.4, 0.3, (3.0, 2.5), (4, 3), 0.1), 6 * 7.5, corner_bound(20)),
        (Cells(0.4, 0.3, 12.0, CODE, 0.1), 5 * 16.0, corner_bound(16)),
    ]
    for shape, expected, bound in cases:
        assert area(shape.coverage(c)) == pytest.approx(expected, abs=bound)


def test_share_of_a_square_matches_counting():
    """The share beyond an oblique line against 1000 × 1000 points in the square."""
    at = (np.arange(1000) + 0.5) / 1000 - 0.5
    u, v = np.meshgrid(at, at)
    for slope_a, slope_b in ((0.9, 0.2), (-0.3, 0.5), (1.0, 1.0), (0.0, 0.7)):
        for offset in (-0.45, -0.2, 0.0, 0.31):
            c = Chart(
                a=np.array(offset),
                b=np.array(0.0),
                a_per_px=(np.array(slope_a), np.array(slope_b)),
                b_per_px=(np.array(0.0), np.array(1.0)),
                footprint_px=1.0,
            )
            counted = float((offset + slope_a * u + slope_b * v > 0).mean())
            # a line passes through at most 2 000 of the million cells, each in doubt by half
            assert float(c.coverage(c.a, 1.0, 0.0)) == pytest.approx(counted, abs=1e-3)


def test_quarters_complete_the_disc():
    """Along and across share the disc between them, sample by sample."""
    c = chart()
    both = [Quadrants(0.4, 0.3, 6.0, 0.1, along=x).coverage(c) for x in (True, False)]
    np.testing.assert_allclose(sum(both), Disc(0.4, 0.3, 6.0, 0.1).coverage(c), atol=1e-12)


def test_quarters_lie_along_and_across_the_first_axis():
    """Points on the axes, well inside the disc, are painted or not as the contract says."""
    zero = np.array(0.0)
    one = np.array(1.0)
    points = Chart(
        a=np.array([2.0, -2.0, 0.0, 0.0]),
        b=np.array([0.0, 0.0, 2.0, -2.0]),
        a_per_px=(one, zero),
        b_per_px=(zero, one),
        footprint_px=0.25,
    )
    assert Quadrants(0.0, 0.0, 5.0, 0.1, along=True).coverage(points).tolist() == [1, 1, 0, 0]
    assert Quadrants(0.0, 0.0, 5.0, 0.1, along=False).coverage(points).tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("along", [True, False])
def test_quarters_balance_about_the_marker_centre(along):
    """The painted area's centroid is the marker's centre: the crossing in the middle has no
    lever, the four corners at the rim err by a quarter of their cell at `radius`."""
    c = chart()
    centre, radius = np.array([0.4, 0.3]), 6.0
    share = Quadrants(float(centre[0]), float(centre[1]), radius, 0.1, along).coverage(c)
    centroid = np.array([(share * c.a).sum(), (share * c.b).sum()]) / share.sum()
    bound = corner_bound(4, radius, math.pi * radius) * radius / (math.pi * radius**2 / 2)
    np.testing.assert_allclose(centroid, centre, atol=bound)


def test_an_unpainted_field_has_no_outline():
    """The outer edge of a chequer's empty fields is no edge."""
    checker = Checker(0.0, 0.0, (3.0, 3.0), (4, 4), 0.1)
    c = chart(turn=0.0, shift=(0.0, 0.0))
    field = (c.a > 0.5) & (c.a < 2.5) & (c.b > 3.5)  # row 3, column 2: an empty field
    assert checker.coverage(c)[field].max() == 0.0


def test_cells_are_painted_row_by_row():
    """In the middle of each cell the code itself is seen: the first row at the smallest second
    coordinate, the first cell of a row at the smallest first one."""
    a, b = np.meshgrid([-4.0, 0.0, 4.0], [-4.0, 0.0, 4.0])
    one, zero = np.array(1.0), np.array(0.0)
    middles = Chart(a + 0.4, b + 0.3, (one, zero), (zero, one), 0.25)
    seen = Cells(0.4, 0.3, 12.0, CODE, 0.1).coverage(middles)
    assert seen.tolist() == [[float(cell) for cell in row] for row in CODE]


def test_an_oblong_chequer_starts_with_paint():
    """Fields of 3 × 2 mm: the first along both axes is painted, its neighbours are not."""
    one, zero = np.array(1.0), np.array(0.0)
    at = Chart(np.array([-4.5, -1.5, -4.5, -1.5]), np.array([-2.0, -2, 0, 0]), (one, zero),
               (zero, one), 0.25)  # fmt: skip
    assert Checker(0, 0, (3.0, 2.0), (4, 3), 0.1).coverage(at).tolist() == [1, 0, 0, 1]
