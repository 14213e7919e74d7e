"""Two calibrations compared: Welch's test, covariances by hand, sheets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, ttest_ind

from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.measurement.agreement import (
    Differences,
    agreements,
    chi_squared,
    scale_difference,
    sheet_agreement,
)
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import PLANE_PARTS, Covariance, NoiseComponents, Source
from sheetoflight.model.light_plane import LightPlane

SHEET = tuple(f"laser.{part}" for part in PLANE_PARTS)
NORMAL = normalised(np.array([0.9, 0.1, 0.4]))


def calibration(
    covariance: Covariance, alpha: float = 2000.0, normal: Array = NORMAL, distance: float = 500.0
) -> Calibration:
    return Calibration(
        method="joint",
        camera=Camera((1000, 800), alpha, 2000.0, 499.5, 399.5),
        light_planes=(LightPlane(normal, distance),),
        covariance=covariance,
        residuals=Residuals(0.1, 1.0),
        target=None,
        pixel_std=0.1,
    )


def sampled(values: Array) -> Calibration:
    """A focal length that is a mean of values, and a distance that nobody estimated."""
    matrix = np.array([[np.var(values, ddof=1) / len(values)]])
    noise = NoiseComponents(
        ("pixel",), (float(np.std(values)),), np.array([[2.0 / (len(values) - 1)]])
    )
    share = (Source("camera", matrix, "pixel"),)
    covariance = Covariance(("camera.alpha",), matrix, share, noise)
    return calibration(covariance, float(values.mean()))


def known_sheet(turns: Array, distance: float, std: tuple[float, float]) -> Calibration:
    """A sheet turned by angles ``(2,)`` about its tangents, with std of turn and distance."""
    first, second = tangent_basis(NORMAL)
    normal = normalised(NORMAL + turns[0] * first + turns[1] * second)
    tangents = np.stack(tangent_basis(normal), axis=1)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = std[0] ** 2 * tangents @ tangents.T
    matrix[3, 3] = std[1] ** 2
    return calibration(Covariance(SHEET, matrix), normal=normal, distance=distance)


def test_one_parameter_is_compared_by_welch_s_test() -> None:
    rng = np.random.default_rng(0)
    one, other = 2000.0 + rng.normal(size=6), 2001.0 + 3.0 * rng.normal(size=4)
    found = chi_squared(Differences(sampled(one), sampled(other)))
    expected: Any = ttest_ind(one, other, equal_var=False)
    assert found.value == pytest.approx(expected.statistic**2)
    assert found.freedom == pytest.approx(expected.df)
    assert found.odds == pytest.approx(expected.pvalue)


def test_a_sheet_has_three_degrees_of_freedom() -> None:
    """Small turns and a distance of known std: chi-squared is the sum of their squares."""
    one = known_sheet(np.zeros(2), 500.0, (3e-4, 0.3))
    other = known_sheet(np.array([1e-3, -5e-4]), 500.8, (4e-4, 0.4))
    found = chi_squared(Differences(one, other))
    expected = (1.0**2 + 0.5**2) / 0.5**2 + 0.8**2 / 0.5**2
    assert found.size == 3
    assert math.isinf(found.freedom)
    assert found.value == pytest.approx(expected, rel=1e-3)
    assert found.odds == pytest.approx(chi2.sf(expected, 3), rel=1e-2)


def test_scale_is_told_from_the_rest() -> None:
    one = known_sheet(np.zeros(2), 500.0, (3e-4, 0.3))
    other = known_sheet(np.array([1e-3, 0.0]), 505.0, (4e-4, 0.4))
    scale = scale_difference(Differences(one, other))
    assert scale is not None
    assert scale.relative == pytest.approx(0.01, rel=1e-6)
    assert scale.std == pytest.approx(0.5 / 500.0, rel=1e-6)
    assert scale.odds == pytest.approx(chi2.sf(100.0, 1), rel=1e-2)
    assert scale.rest_odds == pytest.approx(chi2.sf(4.0, 2), rel=1e-2)


def test_parameters_bear_the_std_of_both() -> None:
    one = known_sheet(np.zeros(2), 500.0, (3e-4, 0.3))
    other = known_sheet(np.zeros(2), 501.0, (4e-4, 0.4))
    last = agreements(Differences(one, other))[-1]
    assert (last.name, last.difference) == ("laser.d", pytest.approx(1.0))
    assert last.std == pytest.approx(0.5)
    assert last.z == pytest.approx(2.0)


def test_points_are_compared_in_millimetres() -> None:
    """A sheet that is d farther away moves every point along its ray by ``d / (n · r)``."""
    one = known_sheet(np.zeros(2), 500.0, (1e-12, 0.3))
    other = known_sheet(np.zeros(2), 502.0, (1e-12, 0.4))
    uv = np.array([[499.5, 399.5], [800.0, 100.0]])
    found = sheet_agreement(Differences(one, other), uv, "laser")
    rays = one.camera.unproject(uv)
    by_distance = np.linalg.norm(rays, axis=1) / (rays @ NORMAL)
    assert found is not None
    assert found.points == 2
    assert found.largest_mm == pytest.approx(2.0 * by_distance.max())
    assert found.rms_mm == pytest.approx(2.0 * np.sqrt(np.mean(by_distance**2)))
    assert found.std_mm == pytest.approx(0.5 * np.sqrt(np.mean(by_distance**2)), rel=1e-5)
    assert found.nearest_mm == pytest.approx((500.0 / (rays @ NORMAL)).min())


def test_what_a_known_camera_brings_to_both_is_counted_once() -> None:
    """Sheets ``S1 c + e1`` and ``S2 c + e2`` of one camera error c differ by ``(S1 − S2) c`` and
    their own noise."""
    rng = np.random.default_rng(1)
    names = ("camera.alpha", "camera.u0", *SHEET)
    root = rng.normal(size=(2, 2))
    camera, slopes = root @ root.T, rng.normal(size=(2, 4, 2))
    noise = [part @ part.T for part in rng.normal(size=(2, 4, 4))]

    def of(slope: Array, own: Array) -> Calibration:
        every = np.concatenate([np.eye(2), slope])
        matrix = every @ camera @ every.T
        matrix[2:, 2:] += own
        return calibration(Covariance(names, matrix))

    found = Differences(*map(of, slopes, noise), camera_known=True)
    apart = slopes[0] - slopes[1]
    expected = apart @ camera @ apart.T + noise[0] + noise[1]
    assert found.names == SHEET
    assert np.allclose(found.covariance(SHEET), expected, rtol=1e-9)


def test_pixels_that_miss_a_sheet_are_left_out() -> None:
    one, other = (known_sheet(np.zeros(2), 500.0, (3e-4, 0.3)) for _ in range(2))
    beside = np.array([[-4500.0, 399.5]])
    assert sheet_agreement(Differences(one, other), beside, "laser") is None


def test_nothing_in_common_is_no_disagreement() -> None:
    sheet, focal = known_sheet(np.zeros(2), 500.0, (3e-4, 0.3)), sampled(np.array([1.0, 2.0]) + 2e3)
    found = Differences(sheet, focal)
    assert agreements(found) == ()
    assert chi_squared(found).odds == 1.0
    assert scale_difference(found) is None
