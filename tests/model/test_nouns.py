"""Values are checked when they are made."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.errors import InputError
from sheetoflight.model.calibration import ViewResiduals
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget


@pytest.mark.parametrize(
    "positions",
    [(0.0, 1.0), (0.0, 2.0, 1.0), (1.0, 2.0, 3.0), (0.0, 1.0, float("nan")), (0.0, 1.0, 1.0)],
    ids=["two", "order", "origin", "nan", "twice"],
)
def test_a_target_needs_three_markers_in_order(positions: tuple[float, ...]) -> None:
    with pytest.raises(InputError):
        CollinearTarget(positions)


def test_unequal_distances_are_welcome() -> None:
    target = CollinearTarget((0, 120, 300, 310))
    assert target.length_mm == 310.0
    assert np.array_equal(target.positions, [0.0, 120.0, 300.0, 310.0])


def test_a_warm_target_is_longer() -> None:
    target = CollinearTarget(
        (0.0, 200.0, 400.0),
        expansion_per_K=1e-5,
        warmer_by_K=10.0,
        warmer_by_std_K=3.0,
        expansion_std_per_K=4e-6,
    )
    assert target.positions[-1] == pytest.approx(400.04)
    assert target.thermal_std == pytest.approx(5e-5)
    with pytest.raises(InputError, match="longer than"):
        CollinearTarget(expansion_per_K=11.5, warmer_by_K=1.0)


def test_a_light_plane_is_normalised_and_read_only() -> None:
    plane = LightPlane(np.array([0.0, 3.0, 4.0]), 100.0)
    assert np.allclose(plane.normal, [0.0, 0.6, 0.8])
    with pytest.raises(ValueError, match="read-only"):
        plane.normal[0] = 1.0


@pytest.mark.parametrize(
    ("normal", "distance"),
    [((0, 0, 0), 1.0), ((0, 0, 1), 0.0), ((0, 0, 1), -5.0), ((0, np.nan, 1), 5.0)],
    ids=["zero", "through the camera", "behind", "nan"],
)
def test_an_impossible_plane_is_refused(normal: tuple[float, ...], distance: float) -> None:
    with pytest.raises(InputError):
        LightPlane(np.array(normal), distance)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_points_of_the_sheet_satisfy_both_forms_of_its_equation(x: float, y: float) -> None:
    plane = LightPlane(np.array([0.9, 0.1, 0.42]), 562.0)
    point = plane.intersect(np.array([x, y, 1.0]))
    if np.isfinite(point).all():
        assert point @ plane.normal == pytest.approx(562.0)
        assert point @ plane.paper_form + 1000.0 == pytest.approx(0.0, abs=1e-6)


def test_views_must_agree_in_shape_and_differ_in_name() -> None:
    with pytest.raises(InputError, match="shape"):
        TargetViews(("a",), np.zeros((2, 3, 2)))
    with pytest.raises(InputError, match="view a is given twice"):
        TargetViews(("a", "a"), np.zeros((2, 3, 2)))
    with pytest.raises(InputError, match="std"):
        TargetViews(("a",), np.zeros((1, 3, 2)), np.zeros((1, 2)))


def test_views_can_be_taken_and_counted() -> None:
    uv = np.arange(18.0).reshape(3, 3, 2)
    uv[1, 2] = np.nan
    views = TargetViews(("a", "b", "c"), uv)
    some = views.take(np.array([True, True, False]))
    assert some.names == ("a", "b")
    assert some.seen.sum() == 5
    assert list(Observations(plane=views).stages()) == ["plane"]


def test_a_covariance_is_zero_for_what_was_held() -> None:
    covariance = Covariance(("camera.alpha", "laser.d"), np.array([[4.0, 1.0], [1.0, 9.0]]))
    assert covariance.std("laser.d") == 3.0
    assert covariance.std("camera.k1") == 0.0
    block = covariance.block(("laser.d", "camera.k1", "camera.alpha"))
    assert np.array_equal(block, [[9.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 4.0]])
    with pytest.raises(InputError):
        Covariance(("a",), np.array([[np.nan]]))


def test_a_rigs_free_intrinsics_follow_its_lens_model() -> None:
    rig = Rig(CollinearTarget(), (640, 480), distortion="radial2", skew=True)
    assert rig.free_intrinsics == ("alpha", "beta", "gamma", "u0", "v0", "k1", "k2")
    with pytest.raises(InputError, match="distortion"):
        Rig(CollinearTarget(), (640, 480), distortion="fisheye")
    with pytest.raises(InputError, match="pixel_std"):
        Rig(CollinearTarget(), (640, 480), pixel_std=0.0)


def test_a_views_rms_counts_only_markers_that_were_seen() -> None:
    residuals = np.array([[3.0, 4.0], [np.nan, np.nan]])
    view = ViewResiduals("camera", "a", np.zeros((2, 2)), residuals, np.zeros((2, 3)))
    assert view.rms_px == pytest.approx(np.sqrt(12.5))
