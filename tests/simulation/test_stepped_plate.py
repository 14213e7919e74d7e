"""A bare plate that a stage moves along a sheet of light."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from sheetoflight.simulation.rig import field_centre, paper_rig
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views

RIG = paper_rig((-0.1, 0.05, 0.0, 0.0, 0.0))
PLATE = SteppedPlate(edges_mm=(-80.0, -10.0, 60.0), travel_mm=(-90.0, 0.0, 40.0, 120.0))


def test_the_points_lie_in_the_sheet_as_far_apart_as_their_places() -> None:
    points, places = PLATE.points(RIG).reshape(-1, 3), PLATE.places.reshape(-1, 2)
    assert np.allclose(RIG.light_plane.heights(points), 0.0, rtol=0, atol=1e-9)
    apart = [np.linalg.norm(x[:, None] - x[None], axis=2) for x in (points, places)]
    assert np.allclose(*apart, rtol=0, atol=1e-9)
    middle = SteppedPlate((0.0, 50.0), (0.0, 50.0)).points(RIG)[0, 0]
    assert np.allclose(middle, field_centre(RIG))


def test_every_step_is_a_view_with_its_points_and_places() -> None:
    views = stepped_plate_views(RIG, PLATE, np.random.default_rng(0))
    assert views.names == ("step00", "step01", "step02", "step03")
    assert views.line.view.tolist() == np.repeat(range(4), 3).tolist()
    assert np.array_equal(views.line.places, PLATE.places.reshape(-1, 2))
    assert np.allclose(views.line.uv, RIG.camera.project(PLATE.points(RIG)).reshape(-1, 2))
    assert np.isnan(views.line.std).all()


def test_points_outside_the_picture_are_left_out() -> None:
    wide = SteppedPlate(edges_mm=(-80.0, 4000.0))
    views = stepped_plate_views(RIG, wide, np.random.default_rng(0))
    assert (views.line.places[:, 0] == -80.0).all()
    assert len(views.line) == 5


def test_noise_is_as_large_as_asked_and_the_stage_s_is_one_a_step() -> None:
    """Sums of squares over their variances, within the limits that chance passes in 5000."""
    many = SteppedPlate(travel_mm=np.linspace(-150.0, 150.0, 400).tolist())
    views = stepped_plate_views(RIG, many, np.random.default_rng(1), 0.2, 0.05)
    off = views.line.uv - RIG.camera.project(many.points(RIG)).reshape(-1, 2)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], off.size)
    assert low < np.sum((off / 0.2) ** 2) < high
    shift = (views.line.places - many.places.reshape(-1, 2)).reshape(400, 2, 2)
    assert np.array_equal(shift[..., 0], np.zeros((400, 2)))
    assert shift[:, 0, 1] == pytest.approx(shift[:, 1, 1], abs=1e-12)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 400)
    assert low < np.sum((shift[:, 0, 1] / 0.05) ** 2) < high
    assert (views.line.std == 0.2).all()
