"""An object that moves through the sheet of light: what it was before it moved."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.measurement.moving_object import line_moved_back, moved_back
from sheetoflight.measurement.straightness import lines_of
from sheetoflight.model.point_cloud import PointCloud, joined_clouds

NORMAL = np.array([0.36, 0.48, 0.8])
DISTANCE_MM = 562.3
STEP = np.array([3.0, -1.0, 0.5])


def seen_at(steps: int, tilt: np.ndarray, offset_mm: float) -> PointCloud:
    """Points of the plane ``tilt · X = offset_mm``, moved so often, in the sheet of light."""
    moved_mm = offset_mm + steps * float(tilt @ STEP)
    direction = np.cross(NORMAL, tilt)
    rows = np.stack([NORMAL, tilt, direction])
    middle = np.linalg.solve(rows, [DISTANCE_MM, moved_mm, 0.0])
    along = np.linspace(-40.0, 50.0, 30)
    count = len(along)
    return PointCloud(
        xyz=middle + along[:, None] * direction,
        std_xyz=np.full((count, 3), 0.01),
        noise_std=np.full(count, 0.01),
        uv=np.zeros((count, 2)),
        peak=np.ones(count),
        line=np.zeros(count, dtype=np.int64),
        picture=np.zeros(count, dtype=np.int64),
        pictures=(f"f[{steps}]",),
    )


@pytest.mark.parametrize("tilt", [(0.6, 0.0, 0.8), (0.0, 1.0, 0.0), (-0.48, 0.6, 0.64)])
@pytest.mark.parametrize("numbers", [range(6), (0, 1, 4, 5)], ids=["all", "some lost"])
def test_a_moved_plane_comes_out_plane(tilt: tuple[float, ...], numbers: range) -> None:
    normal = np.array(tilt)
    found = joined_clouds([moved_back(seen_at(k, normal, 480.0), STEP, k) for k in numbers])
    assert np.abs(found.xyz @ normal - 480.0).max() < 1e-9
    as_seen = joined_clouds([seen_at(k, normal, 480.0) for k in numbers])
    assert np.abs(as_seen.xyz @ normal - 480.0).max() > 1.0
    assert np.array_equal(found.std_xyz, as_seen.std_xyz)


def test_to_move_back_and_forth_changes_nothing() -> None:
    cloud = seen_at(3, np.array([0.6, 0.0, 0.8]), 480.0)
    assert np.allclose(moved_back(moved_back(cloud, STEP, 3), -STEP, 3).xyz, cloud.xyz)
    assert np.array_equal(moved_back(cloud, STEP, 0).xyz, cloud.xyz)


def test_a_line_moves_with_its_points() -> None:
    cloud = seen_at(2, np.array([0.6, 0.0, 0.8]), 480.0)
    (line,), (expected,) = lines_of(cloud), lines_of(moved_back(cloud, STEP, 2))
    moved = line_moved_back(line, STEP, 2)
    assert np.allclose(moved.point, expected.point)
    assert np.allclose(moved.direction, line.direction)
    assert (moved.length_mm, moved.points) == (line.length_mm, line.points)
