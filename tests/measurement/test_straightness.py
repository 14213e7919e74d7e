"""Lines in space against orthogonal regression, linear programs and simulated noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, linprog

from sheetoflight.errors import InputError
from sheetoflight.geometry.rotations import rotation
from sheetoflight.measurement.reconstruction import reconstruct
from sheetoflight.measurement.straightness import fitted_line_in_space, lines_of
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.point_cloud import PointCloud
from sheetoflight.model.stripe import Stripe

E1 = np.array([0.6, 0.0, 0.8])
E2 = np.array([0.48, 0.8, -0.36])
ORIGIN = np.array([30.0, -20.0, 700.0])


def cloud_of(flat: np.ndarray, noise: np.ndarray | float = 0.01, **parts: object) -> PointCloud:
    """Points ``(N, 2)`` of the plane through ORIGIN along E1 and E2, in space."""
    count = len(flat)
    values: dict[str, object] = {
        "xyz": ORIGIN + flat @ np.stack([E1, E2]),
        "std_xyz": np.full((count, 3), 0.1),
        "noise_std": np.broadcast_to(noise, (count,)),
        "uv": np.zeros((count, 2)),
        "peak": np.ones(count),
        "line": np.zeros(count, dtype=np.int64),
        "picture": np.zeros(count, dtype=np.int64),
        "pictures": ("edge",),
    }
    return PointCloud(**{**values, **parts})  # pyright: ignore[reportArgumentType]


def rough(count: int = 200, seed: int = 0, slope: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Points off a slanted line by bounded errors in proportion to their noise, and that noise."""
    rng = np.random.default_rng(seed)
    noise = rng.uniform(0.01, 0.03, count)
    along = np.sort(rng.uniform(0.0, 80.0, count))
    return np.column_stack([along, slope * along + noise * rng.uniform(-1.7, 1.7, count)]), noise


def test_a_straight_line_is_found_exactly() -> None:
    along = np.linspace(-20.0, 60.0, 40)
    found = fitted_line_in_space(cloud_of(np.column_stack([along, 3.0 - 0.2 * along])))
    expected = (E1 - 0.2 * E2) / np.hypot(1.0, 0.2)
    assert np.allclose(found.direction, expected, atol=1e-12)
    assert found.length_mm == pytest.approx(80.0 * np.hypot(1.0, 0.2))
    assert np.allclose(np.cross(found.point - ORIGIN - 3.0 * E2, expected), 0.0, atol=1e-10)
    assert max(found.rms_mm, found.straightness_mm) < 1e-11
    assert (found.points, found.picture, found.line) == (40, "edge", 0)


def test_the_line_is_that_of_weighted_orthogonal_least_squares() -> None:
    flat, noise = rough()
    found = fitted_line_in_space(cloud_of(flat, noise))

    def distances(line: np.ndarray) -> np.ndarray:
        return (flat @ [-np.sin(line[0]), np.cos(line[0])] - line[1]) / noise

    start = np.array([0.3, 0.0])
    best = least_squares(distances, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    angle, offset = best
    direction = np.cos(angle) * E1 + np.sin(angle) * E2
    across = np.cos(angle) * E2 - np.sin(angle) * E1
    assert np.allclose(found.direction, direction, atol=1e-8)
    assert (found.point - ORIGIN) @ across == pytest.approx(offset, abs=1e-7)
    off = np.abs(distances(best)) * noise
    assert np.allclose(np.abs(found.residuals_mm), off, atol=1e-7)
    assert found.rms_mm == pytest.approx(np.sqrt(np.mean(off**2)))
    assert not found.outlying.any()


@pytest.mark.parametrize("count", [3, 7, 200])
def test_straightness_is_the_least_zone_of_a_linear_program(count: int) -> None:
    flat, noise = rough(count, seed=count, slope=0.0)
    found = fitted_line_in_space(cloud_of(flat, noise))
    along, across = flat.T
    columns = np.column_stack([along, np.ones(count)])
    half = np.full((count, 1), -1.0)
    zone = linprog(
        [0.0, 0.0, 1.0],
        np.block([[columns, half], [-columns, half]]),
        np.concatenate([across, -across]),
        bounds=[(None, None)] * 3,
    )
    expected = 2.0 * zone.fun / np.hypot(1.0, zone.x[0])
    assert found.straightness_mm == pytest.approx(expected, rel=1e-6)
    assert found.straightness_mm <= np.ptp(found.residuals_mm) * (1 + 1e-12)


def test_moving_and_turning_around_change_nothing() -> None:
    flat, noise = rough()
    cloud = cloud_of(flat, noise)
    found = fitted_line_in_space(cloud)
    turn = rotation(np.array([0.4, -1.1, 0.3]))
    moved = fitted_line_in_space(replace(cloud, xyz=cloud.xyz @ turn.T + [5.0, 6.0, 7.0]))
    backwards = fitted_line_in_space(cloud.taken(np.arange(len(cloud))[::-1]))
    assert np.allclose(moved.direction, turn @ found.direction, atol=1e-9)
    assert np.allclose(backwards.direction, -found.direction, atol=1e-9)
    for name in (
        "length_mm", "rms_mm", "straightness_mm", "noise_straightness_mm",
        "direction_std", "offset_std_mm",
    ):  # fmt: skip
        expected = pytest.approx(getattr(found, name), rel=1e-7)
        assert getattr(moved, name) == expected
        assert getattr(backwards, name) == expected


def test_scaling_the_points_scales_the_lengths() -> None:
    flat, noise = rough()
    found = fitted_line_in_space(cloud_of(flat, noise))
    tenfold = fitted_line_in_space(cloud_of(10.0 * flat, 10.0 * noise))
    for name in ("length_mm", "rms_mm", "straightness_mm", "noise_straightness_mm"):
        assert getattr(tenfold, name) == pytest.approx(10.0 * getattr(found, name), rel=1e-7)
    assert tenfold.direction_std == pytest.approx(found.direction_std)


def test_a_few_wild_points_are_told_and_move_the_line_little() -> None:
    flat, noise = rough(500, slope=0.0)
    wild = np.array([10, 11, 12, 400, 450])
    spoilt = flat.copy()
    spoilt[wild, 1] += 5.0
    clean = fitted_line_in_space(cloud_of(flat, noise))
    found = fitted_line_in_space(cloud_of(spoilt, noise))
    assert np.array_equal(np.flatnonzero(found.outlying), wild)
    assert found.points == 500
    assert found.straightness_mm > 4.9  # they count
    shift = (found.point - clean.point) @ clean.across
    assert abs(shift) < 3 * 5 / 500 * noise.max() * 2  # least squares moves by 5 · 5/500 = 0.05
    assert np.arccos(min(1.0, found.direction @ clean.direction)) < 1e-4


def test_uncertainties_are_the_scatter_of_simulated_lines() -> None:
    """1000 lines: a standard deviation scatters by 2.2 %, so that 11 % have odds below 1e-6. The
    least zone of 200 points is some 3 % narrower than the range that is told."""
    rng = np.random.default_rng(4)
    noise = np.linspace(0.01, 0.03, 200)
    along = np.linspace(0.0, 50.0, 200)
    lines = [
        fitted_line_in_space(cloud_of(np.column_stack([along, noise * z]), noise))
        for z in rng.standard_normal((1000, 200))
    ]
    turned = np.array([line.direction @ E2 for line in lines])
    offsets = np.array([(line.point - ORIGIN) @ E2 for line in lines])
    stated = lines[0]
    assert np.std(turned) == pytest.approx(stated.direction_std, rel=0.11)
    assert np.std(offsets) == pytest.approx(stated.offset_std_mm, rel=0.11)
    widths = np.mean([line.straightness_mm for line in lines])
    assert 0.93 < widths / stated.noise_straightness_mm < 1.0
    ranges = np.ptp(noise * rng.standard_normal((4000, 200)), axis=1)
    assert stated.noise_straightness_mm == pytest.approx(ranges.mean(), rel=0.03)


def test_noise_across_an_oblique_line_is_told_with_the_calibration() -> None:
    """1000 pictures, as above. The sheet is seen obliquely, so that noise across the line's image
    moves points along the line in space too; all of it would be too much."""
    camera = Camera((1392, 1040), 1500.0, 1480.0, 700.0, 510.0, 3.0, (-0.1, 0.02, 0.001, 0.0, 0.0))
    plane = LightPlane(np.array([0.91, 0.09, 0.40]), 560.0)
    calibration = Calibration(
        method="joint",
        camera=camera,
        light_planes=(plane,),
        covariance=Covariance((), np.zeros((0, 0))),
        residuals=Residuals(0.1, 1.0),
        target=None,
        pixel_std=0.1,
    )
    ends = calibration.triangulate(np.array([[600.0, 200.0], [1000.0, 700.0]]))
    points = ends[0] + np.linspace(0.0, 1.0, 60)[:, None] * (ends[1] - ends[0])
    uv, tangent = camera.project(points), np.gradient(camera.project(points), axis=0)
    across = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    rng = np.random.default_rng(6)
    clouds = []
    for step in 0.2 * rng.standard_normal((1000, 60, 1)):
        ones = np.ones(60)
        stripe = Stripe(
            uv + step * across, 0.2 * ones, ones, ones, across, np.zeros(60, dtype=np.int64),
            ones > 0, 1.0, "test", "drawn",
        )  # fmt: skip
        clouds.append(reconstruct(calibration, stripe))
    lines = [fitted_line_in_space(cloud, calibration) for cloud in clouds]
    whole = fitted_line_in_space(clouds[0])
    normal = np.cross(plane.normal, ends[1] - ends[0])
    normal /= np.linalg.norm(normal)
    offsets = np.array([(line.point - ends[0]) @ normal for line in lines])
    turned = np.array([line.direction @ normal for line in lines])
    assert np.std(offsets) == pytest.approx(lines[0].offset_std_mm, rel=0.11)
    assert np.std(turned) == pytest.approx(lines[0].direction_std, rel=0.11)
    assert whole.offset_std_mm > 1.2 * lines[0].offset_std_mm
    assert lines[0].across @ normal * (plane.normal @ np.cross(ends[1] - ends[0], normal)) > 0


def test_every_line_of_every_picture_has_its_own_fit() -> None:
    flat, noise = rough(90)
    line, picture = np.tile([1, 0, 0], 30), np.repeat([0, 1], 45)
    cloud = cloud_of(flat, noise, line=line, picture=picture, pictures=("a", "b"))
    found = lines_of(cloud)
    assert [(one.picture, one.line) for one in found] == [("a", 0), ("a", 1), ("b", 0), ("b", 1)]
    for one in found:
        chosen = (picture == ("a", "b").index(one.picture)) & (line == one.line)
        alone = fitted_line_in_space(cloud.taken(chosen))
        assert np.array_equal(one.residuals_mm, alone.residuals_mm)
    assert lines_of(cloud.taken(np.arange(4))) == []
    assert lines_of(cloud.taken(np.zeros(0, dtype=np.int64))) == []


def test_a_point_beside_exact_ones_does_not_move_their_line() -> None:
    """Noise of zero: what is usual is told by the points themselves."""
    flat = np.column_stack([np.linspace(0.0, 10.0, 21), np.zeros(21)])
    flat[10, 1] = 0.21
    found = fitted_line_in_space(cloud_of(flat, 0.0))
    assert (found.point - ORIGIN) @ E2 == pytest.approx(0.0, abs=1e-8)
    assert found.outlying[10]
    assert found.straightness_mm == pytest.approx(0.21)
    assert found.noise_straightness_mm == found.offset_std_mm == 0.0


def test_what_is_no_line_is_refused() -> None:
    with pytest.raises(InputError, match="line 0 of edge has 2 points"):
        fitted_line_in_space(cloud_of(np.array([[0.0, 0.0], [1.0, 0.0]])))
    with pytest.raises(InputError, match="one and the same"):
        fitted_line_in_space(cloud_of(np.zeros((4, 2))))
