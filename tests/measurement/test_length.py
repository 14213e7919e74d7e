"""Points and lengths with their uncertainty, against differences and Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from sheetoflight.errors import InputError
from sheetoflight.measurement.length import lengths
from sheetoflight.measurement.triangulation import (
    parameter_names,
    triangulate,
    triangulate_with_jacobians,
)
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance, NoiseComponents, Source
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget

CAMERA = Camera((1392, 1040), 2298.7, 2288.8, 689.3, 537.9, 0.4, (-0.1, 0.05, 0.001, -0.001, 0.01))
PLANE = LightPlane(np.array([0.9098, 0.08722, 0.40578]), 562.334)
UV = np.array([[900.0, 200.0], [1000.0, 800.0], [760.0, 500.0]])


def calibrated(
    camera: Camera = CAMERA,
    plane: LightPlane = PLANE,
    covariance: Covariance | None = None,
    tolerance_mm: float = 0.0,
    pixel_std: float = 0.1,
) -> Calibration:
    return Calibration(
        method="joint",
        camera=camera,
        light_planes=(plane,),
        covariance=covariance or Covariance((), np.zeros((0, 0))),
        residuals=Residuals(0.1, 1.0),
        target=CollinearTarget(tolerance_mm=tolerance_mm),
        pixel_std=pixel_std,
    )


def test_points_lie_on_the_sheet_and_project_back() -> None:
    points = triangulate(calibrated(), UV)
    assert np.allclose(points @ PLANE.normal, PLANE.distance_mm)
    assert np.allclose(CAMERA.project(points), UV, atol=1e-8)
    assert np.allclose(triangulate(calibrated(), UV[0]), points[0])


def test_derivatives_agree_with_differences() -> None:
    found = triangulate_with_jacobians(calibrated(), UV)
    for axis, step in enumerate(np.eye(2) * 0.05):
        slope = (triangulate(calibrated(), UV + step) - triangulate(calibrated(), UV - step)) / 0.1
        assert np.allclose(found.by_pixel[..., axis], slope, rtol=1e-5, atol=1e-7)
    for index in range(10):
        h = 1e-3 if index < 5 else 1e-6
        step = h * np.eye(10)[index]
        above, below = (
            triangulate(calibrated(CAMERA.with_parameters(CAMERA.parameters + s)), UV)
            for s in (step, -step)
        )
        slope = (above - below) / (2 * h)
        assert np.allclose(found.by_parameter[..., index], slope, rtol=1e-4, atol=1e-6)


def test_derivatives_by_the_plane_agree_with_differences() -> None:
    """The normal's three components are moved freely; its length is scaled out of n · X = d."""
    found = triangulate_with_jacobians(calibrated(), UV)
    rays = CAMERA.unproject(UV)

    def at(normal: np.ndarray, distance: float) -> np.ndarray:
        return rays * (distance / (rays @ normal))[:, None]

    for index in range(3):
        step = 1e-6 * np.eye(3)[index]
        slope = (at(PLANE.normal + step, 562.334) - at(PLANE.normal - step, 562.334)) / 2e-6
        assert np.allclose(found.by_parameter[..., 10 + index], slope, rtol=1e-5, atol=1e-4)
    slope = (at(PLANE.normal, 562.335) - at(PLANE.normal, 562.333)) / 2e-3
    assert np.allclose(found.by_parameter[..., 13], slope, rtol=1e-6)


def test_a_lengths_uncertainty_is_that_of_a_monte_carlo() -> None:
    """20 000 draws: their standard deviation scatters by 0.5 %, linearisation adds less; the
    limit of 2.5 % is exceeded by chance with odds below 1e-6."""
    rng = np.random.default_rng(8)
    e1 = np.cross(PLANE.normal, [0, 1.0, 0])
    e1 /= np.linalg.norm(e1)
    change = np.zeros((8, 6))
    change[:4, :4] = np.diag([1.5, 1.5, 2.0, 2.0])
    change[4:7, 4] = 3e-4 * e1
    change[7, 5] = 0.4
    names = (
        "camera.alpha", "camera.beta", "camera.u0", "camera.v0",
        "laser.nx", "laser.ny", "laser.nz", "laser.d",
    )  # fmt: skip
    covariance = Covariance(names, change @ change.T)
    stated = calibrated(covariance=covariance).length(UV[0], UV[1])
    draws = []
    for _ in range(20_000):
        step = change @ rng.normal(size=6)
        parameters = CAMERA.parameters.copy()
        parameters[[0, 1, 3, 4]] += step[:4]
        rays = CAMERA.with_parameters(parameters).unproject(
            UV[:2] + rng.normal(scale=0.1, size=(2, 2))
        )
        points = rays * ((562.334 + step[7]) / (rays @ (PLANE.normal + step[4:7])))[:, None]
        draws.append(np.linalg.norm(points[1] - points[0]))
    assert stated.std == pytest.approx(np.std(draws), rel=0.025)
    assert stated.std**2 == pytest.approx(sum(part**2 for _, part in stated.budget))


def test_the_interval_holds_95_per_cent() -> None:
    found = calibrated().length(UV[0], UV[1], std_px=0.2)
    low, high = found.interval
    assert high - low == pytest.approx(2 * 1.959964 * found.std, rel=1e-6)
    assert found.std == pytest.approx(2 * calibrated().length(UV[0], UV[1]).std)


def test_sources_add_up_and_estimated_noise_widens_the_interval() -> None:
    """Student's factor with the effective degrees of freedom of GUM G.4.1."""
    names, matrix = ("laser.d",), np.array([[0.04]])
    sources = (Source("camera", 0.75 * matrix, "pixel"), Source("target length", 0.25 * matrix))
    components = NoiseComponents(("pixel",), (0.1,), np.array([[2.0 / 8.0]]))
    covariance = Covariance(names, matrix, sources, components)
    found = calibrated(covariance=covariance).length(UV[0], UV[1], std_px=1e-9)
    budget = dict(found.budget)
    assert found.std**2 == pytest.approx(sum(part**2 for part in budget.values()))
    assert budget["camera"] ** 2 == pytest.approx(3 * budget["target length"] ** 2)
    freedom = 8.0 / 0.75**2
    assert found.degrees_of_freedom == pytest.approx(freedom)
    reach = student.ppf(0.975, freedom) * found.std
    assert found.interval == pytest.approx((found.value - reach, found.value + reach))


def test_the_image_points_own_noise_is_as_uncertain_as_the_calibrations() -> None:
    components = NoiseComponents(("pixel",), (0.1,), np.array([[2.0 / 8.0]]))
    covariance = Covariance((), np.zeros((0, 0)), (), components)
    estimated = calibrated(covariance=covariance).length(UV[0], UV[1])
    assert estimated.degrees_of_freedom == pytest.approx(8.0)
    stated = calibrated(covariance=covariance).length(UV[0], UV[1], std_px=0.1)
    assert stated.degrees_of_freedom == np.inf


@pytest.mark.parametrize(
    ("point", "said"),
    [((1500.0, 10.0), "outside the 1392×1040"), ((float("nan"), 3.0), "outside")],
    ids=["outside", "nan"],
)
def test_points_off_the_picture_are_refused(point: tuple[float, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        calibrated().length(UV[0], np.array(point))


def test_a_point_that_looks_away_from_the_sheet_is_named() -> None:
    beside = LightPlane(np.array([0.999, 0.0, 0.045]), 500.0)
    ends = np.array([[[1300.0, 500.0], [20.0, 500.0]]])
    with pytest.raises(InputError, match=r"segment rail: point 2 .* behind the camera"):
        lengths(calibrated(plane=beside), ends, names=("rail",))
    assert np.isnan(triangulate(calibrated(plane=beside), ends[0, 1])).all()


def test_a_point_beyond_the_lens_model_is_named() -> None:
    barrel = Camera((1392, 1040), 700.0, 700.0, 695.5, 519.5, distortion=(-0.4, 0, 0, 0, 0))
    with pytest.raises(InputError, match="lens model"):
        calibrated(camera=barrel).length(np.array([700.0, 520.0]), np.array([3.0, 3.0]))


def test_shapes_are_checked() -> None:
    with pytest.raises(InputError, match="expected"):
        triangulate(calibrated(), np.zeros((3, 3)))


def test_parameter_names_are_those_of_the_covariance() -> None:
    names = parameter_names(LightPlane(PLANE.normal, 1.0, "left"))
    assert names[0] == "camera.alpha"
    assert names[-4:] == ("left.nx", "left.ny", "left.nz", "left.d")
