"""Ridge pixels and their chains."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.stripe.light import line_light
from sheetoflight.imaging.stripe.linking import linked
from sheetoflight.imaging.stripe.ridges import ridges, ridges_at
from tests.imaging.stripe.drawn_lines import Strip, drawn

SHAPE = (160, 160)


def picture(*strips: Strip):
    return drawn(SHAPE, *strips).astype(np.float32)


def test_strength_is_the_amplitude_of_a_line_as_wide_as_the_smoothing():
    """Sheet and blur make the line's width 2.0, its height 100 sheet/width = 93.7. The pixel's
    box widens it by another 1/12 px², and a second difference over 1 px sees 1 − 1/(4 · 8.08) of
    the second derivative of a Gaussian of variance 8.08 px²: 89.5 is left."""
    line = Strip((80.3, -20.0), (80.3, 180.0), amplitude=100.0, sheet=1.874, blur=0.7)
    found = ridges_at(picture(line), 2.0, 20.0)
    assert np.median(found.strength) == pytest.approx(89.5, rel=0.02)
    assert np.abs(found.uv[:, 0] - 80.3).max() < 0.05


@pytest.mark.parametrize(("sheet", "scale"), [(0.4, 1.0), (1.3, 2.0), (2.9, 4.0), (6.0, 6.0)])
def test_the_scale_follows_the_line_s_width(sheet, scale):
    """A line of width w answers with s² w / (w² + s²)^1.5, most where s = √2 w."""
    line = Strip((40.0, 60.0), (360.0, 300.0), sheet=sheet, blur=0.4)
    assert ridges(line_light(drawn((400, 400), line)), 10.0).scale == scale


@pytest.mark.parametrize("degrees", [0, 20, 45, 70, 90, 135, 160])
def test_a_line_is_one_chain_from_end_to_end(degrees):
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    first, second = ((float(80 + r * along[0]), float(80 + r * along[1])) for r in (-60, 60))
    found = ridges(line_light(picture(Strip(first, second))), 10.0)
    (chain,) = linked(found, 60.0, 6)
    length = np.linalg.norm(found.uv[chain[-1]] - found.uv[chain[0]])
    assert abs(length - 120.0) < 6.0
    steps = np.diff(found.uv[chain], axis=0)
    assert np.linalg.norm(steps, axis=1).max() < 2.0


def test_crossing_lines_go_straight_on():
    """No chain turns the corner from one line to the other."""
    first, second = Strip((20.0, 40.0), (140.0, 120.0)), Strip((20.0, 120.0), (140.0, 40.0))
    found = ridges(line_light(picture(first, second)), 10.0)
    for chain in linked(found, 60.0, 6):
        distances = []
        for line in (first, second):
            normal = np.array([-line.along[1], line.along[0]])
            distances.append(np.abs((found.uv[chain] - line.first) @ normal).max())
        assert min(distances) < 3.0


def test_a_step_is_no_ridge():
    step = np.where(np.indices(SHAPE)[1] < 80, 20.0, 180.0).astype(np.float32)
    assert len(ridges(line_light(step), 3.0)) == 0
