"""Lengths on the sheet without a camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sheetoflight as sol
from sheetoflight.calibration.camera_free_method import camera_free
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.io.calibration_json import read_any_calibration, read_calibration
from sheetoflight.measurement.length import lengths
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.sheet_map import SheetMap
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed_rig, segments_in_sheet
from sheetoflight.simulation.rig import SimulatedRig, paper_rig


def lying(
    seed: int = 0,
    pixel_std: float = 0.1,
    positions: int = 10,
    target: CollinearTarget | None = None,
) -> tuple[SimulatedRig, Rig]:
    truth = paper_rig(target=target)
    observations = observed_rig(truth, 0, 10, pixel_std, np.random.default_rng(seed))
    return truth, Rig(truth.target, truth.camera.image_size, observations=observations)


@pytest.mark.parametrize("markers", [(0.0, 200.0, 400.0), (0.0, 90.0, 140.0, 400.0)], ids=str)
def test_exact_points_give_exact_lengths(markers: tuple[float, ...]) -> None:
    truth, rig = lying(pixel_std=0.0, target=CollinearTarget(markers))
    found = camera_free(rig)
    ends = truth.camera.project(segments_in_sheet(truth, 300.0, 8, np.random.default_rng(1)))
    assert [m.value for m in lengths(found, ends)] == pytest.approx([300.0] * 8, abs=1e-5)


def test_derivatives_of_a_sheet_map_agree_with_differences() -> None:
    sheet = SheetMap((1392, 1040), 400.0, 30.0, 350.0, 0.2, -0.1)
    uv = np.array([[100.0, 200.0], [900.0, 950.0]])
    xyz, by_pixel, by_parameter = sheet.points_with_jacobians(uv)
    image, by_point, by_map = sheet.image_with_jacobians(xyz[:, :2])
    assert np.allclose(image, uv)
    for axis in range(2):
        step = np.eye(2)[axis] * 1e-4
        slope = (sheet.points(uv + step) - sheet.points(uv - step)) / 2e-4
        assert np.allclose(by_pixel[..., axis], slope, atol=1e-6)
        ends = [sheet.image_with_jacobians(xyz[:, :2] + s)[0] for s in (step, -step)]
        assert np.allclose(by_point[..., axis], (ends[0] - ends[1]) / 2e-4, atol=1e-6)
    for index, name in enumerate(("a", "b", "c", "l1", "l2")):
        h = 1e-5
        above = replace(sheet, **{name: getattr(sheet, name) + h})
        below = replace(sheet, **{name: getattr(sheet, name) - h})
        slope = (above.points(uv) - below.points(uv)) / (2 * h)
        assert np.allclose(by_parameter[..., index], slope, rtol=1e-5, atol=1e-5)
        ends = [s.image_with_jacobians(xyz[:, :2])[0] for s in (above, below)]
        assert np.allclose(by_map[..., index], (ends[0] - ends[1]) / (2 * h), rtol=1e-5, atol=1e-5)


def test_its_intervals_hold() -> None:
    """200 calibrations, one length each: 95 % within four standard errors of 1.5 %."""
    hits = []
    for seed in range(200):
        truth, rig = lying(seed)
        ends = segments_in_sheet(truth, 400.0, 1, np.random.default_rng([9, seed]))
        (found,) = lengths(camera_free(rig), truth.camera.project(ends), np.array([1e-9]))
        hits.append(found.interval[0] <= 400.0 <= found.interval[1])
    assert np.mean(hits) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 200))


def test_a_file_of_it_measures_and_says_that_it_has_no_camera(tmp_path: Path) -> None:
    _, rig = lying()
    found = sol.calibrate(rig, method="camera-free")
    found.save(tmp_path / "c.json")
    back = read_any_calibration(tmp_path / "c.json")
    a, b = np.array([900.0, 300.0]), np.array([950.0, 700.0])
    assert back.length(a, b) == found.length(a, b)
    assert np.array_equal(back.triangulate(a[None]), found.triangulate(a[None]))
    with pytest.raises(InputError, match="no camera"):
        read_calibration(tmp_path / "c.json")


def test_what_cannot_be_told_is_refused() -> None:
    _, rig = lying()
    with pytest.raises(InputError, match="no lens"):
        camera_free(replace(rig, distortion="radial1"))
    two = replace(rig, observations=Observations(plane=rig.observations.plane.take(np.arange(2))))
    with pytest.raises(UntrustworthyError, match="plane stage"):
        camera_free(two)
    first = rig.observations.plane.uv[:1]
    rng = np.random.default_rng(1)
    again = first + rng.normal(scale=0.1, size=(10, *first.shape[1:]))
    views = TargetViews(rig.observations.plane.names, again)
    with pytest.raises(UntrustworthyError, match="plane stage"):
        camera_free(replace(rig, observations=Observations(plane=views)))
