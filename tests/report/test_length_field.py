"""The map of length uncertainty against closed forms and single lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.model.calibration import Residuals
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.report.length_field import field_tables, length_field, length_fields, summary
from tests.report.examples import (
    NO_COVARIANCE,
    NOISE_PX,
    calibration_of_two_lasers,
    example_calibration,
    facing_calibration,
)


def test_facing_a_sheet_pixel_noise_gives_the_same_uncertainty_everywhere():
    """Both ends carry σ Z / f along the length: √2 · 0.1 · 1000 / 2000 = 0.0707 mm."""
    field = length_field(facing_calibration(2000.0))
    assert field is not None
    assert field.length_mm == 100.0
    known = field.std_mm[np.isfinite(field.std_mm)]
    assert known == pytest.approx(np.sqrt(2) * NOISE_PX * 1000.0 / 2000.0, rel=1e-6)
    assert field.depth_mm == pytest.approx(1000.0)


def test_a_length_is_left_out_exactly_where_it_leaves_the_picture():
    field = length_field(facing_calibration(2000.0))
    assert field is not None
    half = 50.0 * 2000.0 / 1000.0
    fits_u = (field.u - half >= -0.5) & (field.u + half <= 1391.5)
    fits_v = (field.v - half >= -0.5) & (field.v + half <= 1039.5)
    assert np.array_equal(np.isfinite(field.std_mm[0]), np.tile(fits_u, (5, 1)))
    assert np.array_equal(np.isfinite(field.std_mm[1]), np.tile(fits_v[:, None], (1, 7)))
    assert 0 < np.isnan(field.std_mm).sum() < field.std_mm.size


def test_a_narrow_field_of_view_is_mapped_with_a_shorter_length():
    """The picture spans 69.6 × 52 mm of the sheet: 50 mm fits at 12 of 70, 20 mm at 46."""
    field = length_field(facing_calibration(20000.0))
    assert field is not None
    assert field.length_mm == 20.0
    assert np.isfinite(field.std_mm).sum() == 46


def test_the_map_agrees_with_single_lengths(calibration):
    """A length along the rows at one place, its ends found by bisection along that row."""
    field = length_field(calibration)
    assert field is not None
    row, column = 2, 4
    u, v = field.u[column], field.v[row]
    middle = calibration.triangulate(np.array([u, v]))

    def end(sign: float) -> np.ndarray:
        near, far = 0.0, 300.0
        for _ in range(60):
            step = (near + far) / 2
            point = calibration.triangulate(np.array([u + sign * step, v]))
            near, far = (step, far) if np.linalg.norm(point - middle) < 50 else (near, step)
        return np.array([u + sign * near, v])

    single = calibration.length(end(-1.0), end(1.0))
    # The straight length leaves the row by the distortion's bend, some hundredths of a pixel.
    assert single.value == pytest.approx(100.0, abs=1e-3)
    assert field.std_mm[0, row, column] == pytest.approx(single.std, rel=1e-3)


def test_the_headline_speaks_of_the_depths_where_targets_stood(calibration):
    field = length_field(calibration)
    assert field is not None
    depths = np.concatenate(
        [v.xyz[:, 2] for v in calibration.residuals.views if v.stage == "plane"]
    )
    assert field.depth_range_mm == (depths.min(), depths.max())
    inside = field.std_mm[:, (field.depth_mm >= depths.min()) & (field.depth_mm <= depths.max())]
    told = summary(field)
    assert float(told.worst) == pytest.approx(np.nanmax(inside), rel=0.05)
    assert float(told.best) == pytest.approx(np.nanmin(inside), rel=0.05)
    assert float(told.worst) < 0.9 * np.nanmax(field.std_mm)
    assert told.depths == f"Z {depths.min():.0f} to {depths.max():.0f} mm"


def test_the_tables_hold_every_place_once(calibration):
    field = length_field(calibration)
    assert field is not None
    rows, columns = field_tables(field)
    for table, std in zip((rows, columns), field.std_mm, strict=True):
        cells = [cell for _, row in table.rows for cell in row]
        assert len(cells) == std.size
        for cell, value, mark in zip(cells, std.ravel(), field.calibrated.ravel(), strict=True):
            assert (
                cell.std == "–"
                if np.isnan(value)
                else float(cell.std) == pytest.approx(value, rel=0.05)
            )
            assert cell.calibrated == mark
            assert 0 <= cell.shade <= 1


def test_a_sheet_that_the_camera_does_not_see_has_no_map():
    behind = LightPlane(np.array([0.0, 0.0, -1.0]), 1000.0)
    assert length_field(example_calibration(light_planes=(behind,))) is None


def test_without_covariance_there_is_no_map():
    bare = example_calibration(covariance=NO_COVARIANCE)
    assert length_field(bare) is None
    assert length_fields(bare) == ()


def test_every_sheet_has_a_map_of_its_own():
    """The map of a laser is that of a calibration which has this laser alone."""
    both = calibration_of_two_lasers()
    fields = length_fields(both)
    assert [field.laser for field in fields] == ["left", "right"]
    for field, plane in zip(fields, both.light_planes, strict=True):
        alone = length_field(replace(both, light_planes=(plane,), residuals=Residuals(0.1, 1.0)))
        assert alone is not None
        assert field.std_mm == pytest.approx(alone.std_mm, nan_ok=True)
        assert np.isfinite(field.depth_range_mm).all()
        inside = field.representative_std_mm
        assert np.sum(inside < field.typical.std) <= len(inside) / 2
        assert np.sum(inside > field.typical.std) <= len(inside) / 2
