"""Laws that every method of calibration obeys, and its refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.methods import CalibrationOptions, calibrate
from sheetoflight.calibration.paper_plane import PaperOptions, paper_plane
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.estimation.genetic import GeneticOptions
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import segments_in_sheet
from tests.calibration.examples import simulated

QUICK = CalibrationOptions(PaperOptions(genetic=GeneticOptions(100, 80)))
LIKELY = ("joint", "two-step")
FOR_RODS = (*LIKELY, "paper")


@pytest.mark.parametrize("method", FOR_RODS)
@pytest.mark.parametrize("positions", [(0.0, 200.0, 400.0), (0.0, 120.0, 300.0)], ids=str)
def test_exact_points_give_exact_lengths(method: str, positions: tuple[float, ...]) -> None:
    truth, rig = simulated(0.0, target=CollinearTarget(positions))
    calibration = calibrate(rig, method, QUICK)
    # the genetic search ends some 1e-5 of its bounds away from the minimum
    tolerance = 1e-5 if method in LIKELY else 0.05
    ends = segments_in_sheet(truth, 300.0, 5, np.random.default_rng(1))
    for uv in truth.camera.project(ends):
        assert calibration.length(*uv).value == pytest.approx(300.0, abs=tolerance)


@pytest.mark.parametrize("distortion", ["none", "radial1", "radial2", "brown"])
def test_every_lens_model_is_found_exactly(distortion: str) -> None:
    truth, rig = simulated(0.0, distortion=distortion)
    camera = calibrate(rig).camera
    assert np.allclose(camera.parameters, truth.camera.parameters, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("method", LIKELY)
def test_the_order_of_views_does_not_matter(method: str) -> None:
    _, rig = simulated()
    shuffled = np.random.default_rng(3).permutation
    seen = rig.observations
    other = replace(
        rig,
        observations=Observations(
            seen.camera.take(shuffled(len(seen.camera))), seen.plane.take(shuffled(len(seen.plane)))
        ),
    )
    one, two = calibrate(rig, method), calibrate(other, method)
    assert np.allclose(one.camera.parameters, two.camera.parameters, rtol=1e-8, atol=1e-8)
    assert np.allclose(one.light_plane.normal, two.light_plane.normal, atol=1e-9)


@pytest.mark.parametrize("method", LIKELY)
def test_scaling_the_target_scales_the_lengths(method: str) -> None:
    _, rig = simulated()
    doubled = replace(rig, target=CollinearTarget((0.0, 400.0, 800.0)))
    one, two = calibrate(rig, method), calibrate(doubled, method)
    a, b = np.array([900.0, 300.0]), np.array([950.0, 700.0])
    assert np.allclose(one.camera.parameters, two.camera.parameters, rtol=1e-8, atol=1e-6)
    assert two.length(a, b).value == pytest.approx(2 * one.length(a, b).value, rel=1e-8)
    assert two.length(a, b).std == pytest.approx(2 * one.length(a, b).std, rel=1e-6)


def test_a_marker_that_was_not_seen_is_done_without() -> None:
    truth, rig = simulated(0.0, target=CollinearTarget((0.0, 100.0, 250.0, 400.0)))
    camera, plane = rig.observations.camera, rig.observations.plane
    uv, flat = camera.uv.copy(), plane.uv.copy()
    uv[3, 1], uv[5, 0], flat[2, 3], flat[4, 1] = (np.nan,) * 4
    hidden = Observations(TargetViews(camera.names, uv), TargetViews(plane.names, flat))
    for method in FOR_RODS:
        calibration = calibrate(replace(rig, observations=hidden), method, QUICK)
        assert np.allclose(calibration.camera.matrix, truth.camera.matrix, atol=1e-4)
        # the genetic search leaves 1 % of its own half width of 5 %; the others are exact
        tolerance = 1e-4 if method in LIKELY else 0.01 * 0.05 * 562.334
        assert calibration.light_plane.distance_mm == pytest.approx(562.334, abs=tolerance)


def test_the_joint_adjustment_knows_the_sheet_best() -> None:
    """More information in one system: its standard uncertainties are the smallest."""
    _, rig = simulated(0.1, stated=True)
    found = {method: calibrate(rig, method, QUICK) for method in FOR_RODS}
    a, b = np.array([900.0, 300.0]), np.array([950.0, 700.0])
    std = {method: found[method].length(a, b, std_px=1e-9).std for method in FOR_RODS}
    assert std["joint"] < std["two-step"] < std["paper"]


def test_noise_is_estimated_where_it_is_not_stated() -> None:
    # rms over 110 degrees of freedom scatters by 1/sqrt(220) = 7 %; four of these: odds 6e-5
    _, rig = simulated(0.2)
    calibration = calibrate(rig)
    assert calibration.pixel_std == pytest.approx(0.2, rel=4 / np.sqrt(2 * 110))
    assert calibration.residuals.chi2_per_dof == pytest.approx(1.0)
    assert not calibration.warnings


def test_noise_larger_than_stated_enlarges_the_uncertainty_and_warns() -> None:
    _, honest = simulated(0.3)
    boastful = replace(honest, pixel_std=0.05)
    one, two = calibrate(honest), calibrate(boastful)
    assert two.covariance.std("camera.alpha") == pytest.approx(
        one.covariance.std("camera.alpha"), rel=1e-6
    )
    assert two.residuals.chi2_per_dof > 10
    assert "stated noise" in two.warnings[0]


def test_every_view_is_accounted_for() -> None:
    """Names in order; observed = predicted + residual, to rounding."""
    _, rig = simulated(0.1)
    for method in FOR_RODS:
        found = calibrate(rig, method, QUICK)
        names = [view.view for view in found.residuals.views]
        assert names == [*rig.observations.camera.names, *rig.observations.plane.names]
        for view in found.residuals.views:
            assert np.allclose(found.camera.project(view.xyz) + view.residuals, view.uv, atol=1e-9)


def few(rig: Rig, camera: int, plane: int) -> Rig:
    seen = rig.observations
    return replace(
        rig,
        observations=Observations(
            seen.camera.take(np.arange(camera)), seen.plane.take(np.arange(plane))
        ),
    )


@pytest.mark.parametrize("method", FOR_RODS)
@pytest.mark.parametrize(
    ("views", "stage"), [((1, 10), "camera"), ((2, 10), "camera"), ((30, 1), "plane"),
                         ((0, 10), "camera"), ((30, 0), "plane")], ids=str,
)  # fmt: skip
def test_too_few_views_are_refused(method: str, views: tuple[int, int], stage: str) -> None:
    _, rig = simulated()
    with pytest.raises(UntrustworthyError, match=f"{stage} stage") as caught:
        calibrate(few(rig, *views), method, QUICK)
    assert any(word in str(caught.value) for word in ("needed", "do not determine"))


def test_few_camera_views_suffice_where_the_sheet_tells_the_rest() -> None:
    """Four swings and one sheet: 3 + 2 constraints on the four parameters of K."""
    truth, rig = simulated()
    found = calibrate(few(rig, 4, 10))
    error = found.camera.alpha - truth.camera.alpha
    assert abs(error) < 4 * found.covariance.std("camera.alpha")
    with pytest.raises(UntrustworthyError, match="camera stage"):
        calibrate(few(rig, 4, 10), "two-step")


@pytest.mark.parametrize("method", FOR_RODS)
def test_one_position_repeated_is_refused(method: str) -> None:
    _, rig = simulated()
    rng = np.random.default_rng(0)
    lying = rig.observations.plane
    uv = lying.uv[:1] + rng.normal(scale=0.05, size=lying.uv.shape)
    again = replace(rig.observations, plane=TargetViews(lying.names, uv))
    with pytest.raises(UntrustworthyError):
        calibrate(replace(rig, observations=again), method, QUICK)


def test_unknown_methods_and_wrong_targets_are_refused() -> None:
    _, rig = simulated()
    with pytest.raises(InputError, match="choose joint"):
        calibrate(rig, "magic")
    with pytest.raises(InputError, match="markers"):
        calibrate(replace(rig, target=CollinearTarget((0.0, 1.0, 2.0, 3.0))))


@pytest.mark.parametrize("lasers", [(), ("laser",)])
def test_a_rig_without_views_is_refused(lasers: tuple[str, ...]) -> None:
    with pytest.raises(UntrustworthyError, match="no views at all"):
        calibrate(Rig(CollinearTarget(), (1392, 1040), lasers=lasers))


def test_a_view_with_one_marker_is_named() -> None:
    _, rig = simulated()
    uv = rig.observations.camera.uv.copy()
    uv[7, 1:] = np.nan
    camera = TargetViews(rig.observations.camera.names, uv)
    with pytest.raises(InputError, match="camera07"):
        calibrate(replace(rig, observations=replace(rig.observations, camera=camera)))


def test_the_papers_plane_ignores_gross_outliers() -> None:
    truth, _ = simulated()
    rng = np.random.default_rng(4)
    ends = segments_in_sheet(truth, 400.0, 10, rng)
    points = np.stack([ends[:, 0], ends.mean(axis=1), ends[:, 1]], axis=1)
    points[3] += 40.0 * truth.light_plane.normal
    plane = paper_plane(points, PaperOptions())
    assert not plane.used[3].any()
    assert plane.agreeing == 27
    assert np.allclose(plane.normal, truth.light_plane.normal, atol=1e-4)


def test_few_inliers_are_said_so() -> None:
    _, rig = simulated(1.0)
    calibration = calibrate(rig, "paper", QUICK)
    assert "0.94 mm" in calibration.warnings[0]


def test_camera_views_that_show_two_markers_help_and_do_no_harm() -> None:
    """30 whole views and 10 that lack a far marker; alpha within four standard uncertainties."""
    truth, rig = simulated(0.1, (40, 10))
    uv = rig.observations.camera.uv.copy()
    uv[:10, 1] = np.nan
    camera = TargetViews(rig.observations.camera.names, uv)
    found = calibrate(replace(rig, observations=replace(rig.observations, camera=camera)))
    error = found.camera.alpha - truth.camera.alpha
    assert abs(error) < 4 * found.covariance.std("camera.alpha")


def test_a_pivot_that_is_never_seen_is_refused() -> None:
    _, rig = simulated()
    uv = rig.observations.camera.uv.copy()
    uv[:, 0] = np.nan
    camera = TargetViews(rig.observations.camera.names, uv)
    with pytest.raises(UntrustworthyError):
        calibrate(replace(rig, observations=replace(rig.observations, camera=camera)))


def test_a_marker_that_is_off_is_named_and_left_out() -> None:
    truth, rig = simulated(0.1)
    uv = rig.observations.camera.uv.copy()
    uv[7, 0] += [0.0, 8.0]
    camera = TargetViews(rig.observations.camera.names, uv)
    found = calibrate(replace(rig, observations=replace(rig.observations, camera=camera)))
    assert any("marker 0 of view camera07 of stage camera" in text for text in found.warnings)
    error = found.camera.alpha - truth.camera.alpha
    assert abs(error) < 4 * found.covariance.std("camera.alpha")
    assert not calibrate(rig).warnings


def test_a_view_with_reversed_markers_is_named_and_left_out() -> None:
    truth, rig = simulated()
    uv = rig.observations.camera.uv.copy()
    uv[7] = uv[7, ::-1]
    camera = TargetViews(rig.observations.camera.names, uv)
    found = calibrate(replace(rig, observations=replace(rig.observations, camera=camera)))
    assert any("view camera07 of stage camera" in text for text in found.warnings)
    assert abs(found.camera.alpha - truth.camera.alpha) < 4 * found.covariance.std("camera.alpha")


def test_the_variance_factor_of_two_step_is_that_of_the_camera_stage() -> None:
    """In-plane residuals under a camera that is off are not noise: with few camera views and many
    positions they would double it. Mean of 20 estimates, each scattering by 14 % (26 degrees of
    freedom): four standard errors are 13 %."""
    found = [
        calibrate(simulated(0.1, (12, 20), seed=seed)[1], "two-step").pixel_std
        for seed in range(20)
    ]
    assert np.mean(found) == pytest.approx(0.1, rel=0.13)
