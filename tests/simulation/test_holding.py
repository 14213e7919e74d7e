"""How targets are held: angles and margins, with hand-made poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.simulation.holding import Holding, held

UNLIT = Holding(max_tilt_deg=60.0, margin_px=10.0, radius_mm=15.0, laser=False)
MIDDLE = np.array([0.0, 0.0, 1000.0])


def strip(tilt_deg: float, half: float = 50.0) -> np.ndarray:
    """A strip whose axis is tilted from square to the line of sight, in the x–z plane."""
    tilt = math.radians(tilt_deg)
    return MIDDLE + np.outer([-half, 0.0, half], [math.cos(tilt), 0.0, math.sin(tilt)])


@pytest.mark.parametrize(("tilt", "accepted"), [(0, True), (55, True), (-55, True), (65, False)])
def test_tilt_from_the_camera(small_rig, tilt, accepted):
    """The strip's ends are seen 1–3° steeper or flatter than its middle."""
    assert UNLIT.accepts(small_rig, strip(tilt)) is accepted


def test_a_strip_along_the_light_is_not_lit(small_rig):
    """Seen well, but the light runs along it."""
    to_projector = small_rig.projector_mm - MIDDLE
    to_projector /= np.linalg.norm(to_projector)
    points = MIDDLE + np.outer([-50.0, 0.0, 50.0], to_projector)
    assert replace(UNLIT, max_tilt_deg=75.0).accepts(small_rig, points)
    assert not replace(UNLIT, max_tilt_deg=75.0, laser=True).accepts(small_rig, points)


def test_rims_keep_their_distance_from_the_edge(small_rig):
    """The right end's rim is at ``u0 + alpha (half + radius)/Z``."""
    camera = small_rig.camera
    widest = (camera.image_size[0] - 1 - 10.0 - camera.u0) * 1000.0 / camera.alpha - 15.0
    assert UNLIT.accepts(small_rig, strip(0.0, widest - 0.1))
    assert not UNLIT.accepts(small_rig, strip(0.0, widest + 0.1))


def test_the_first_acceptable_poses_are_kept_in_order(small_rig):
    tilts = iter([70.0, 10.0, 80.0, 20.0, 30.0] * 8)
    poses = held(
        small_rig, 3, lambda n: np.array([strip(next(tilts)) for _ in range(n)]), UNLIT, "views"
    )
    for points, tilt in zip(poses, (10.0, 20.0, 30.0), strict=True):
        np.testing.assert_array_equal(points, strip(tilt))


def test_nothing_acceptable_is_an_error(small_rig):
    with pytest.raises(InputError, match="only 0 of 1 views could be held"):
        held(small_rig, 1, lambda n: np.array([strip(80.0)] * n), UNLIT, "views")
