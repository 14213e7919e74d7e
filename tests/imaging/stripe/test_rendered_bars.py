"""Ends of bars in rendered pictures against the projected true ends."""

from __future__ import annotations

import numpy as np
import pytest

from bench.line_ends import LENGTHS_MM, measured_bars
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.views import ViewOptions


def small_rig() -> SimulatedRig:
    """400 × 300 px of the paper's geometry, so that a picture takes a fraction of a second.

    A pixel covers 2.3 times as many millimetres as in the paper's rig, and the bars' ends are
    as many times fewer pixels apart.
    """
    big = paper_rig()
    camera = Camera((400, 300), 1000.0, 995.0, 198.3, 151.2)
    plane = LightPlane(big.light_plane.normal, big.light_plane.distance_mm)
    return SimulatedRig(camera, (plane,), projector_mm=big.projector_mm)


def test_ends_of_rendered_bars_are_unbiased_and_as_good_as_stated():
    """16 ends: the mean within 4 stated standard errors plus 0.02 px, their normalised root
    mean square below 1.75 (chi-squared with 16 degrees of freedom: once in 3000 times)."""
    bars = measured_bars(small_rig(), [100.0, 150.0] * 4, ViewOptions(clutter=8, bar_width_mm=40.0))
    assert all(bar is not None for bar in bars)
    along = np.concatenate([bar.along for bar in bars if bar is not None])
    across = np.concatenate([bar.across for bar in bars if bar is not None])
    std = np.concatenate([bar.std for bar in bars if bar is not None])
    assert abs(along.mean()) < 0.02 + 4.0 * np.sqrt(np.mean(std**2) / along.size)
    assert np.sqrt(np.mean((along / std) ** 2)) < 1.75
    assert np.abs(across).max() < 0.08


@pytest.mark.accuracy
def test_ends_of_bars_in_the_papers_rig():
    """36 bars: what the lengths of the paper's Table 4 may owe to the detection of their ends."""
    bars = measured_bars(paper_rig(), [length for length in LENGTHS_MM for _ in range(12)])
    found = [bar for bar in bars if bar is not None]
    assert len(found) == len(bars)
    along = np.concatenate([bar.along for bar in found])
    across = np.concatenate([bar.across for bar in found])
    assert abs(along.mean()) < 0.02
    assert along.std() < 0.04
    assert abs(across.mean()) < 0.02
    assert across.std() < 0.02
