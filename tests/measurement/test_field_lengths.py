"""Where lengths are compared: on the sheet, in the picture, where targets stood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.measurement.field_lengths import field_segments
from sheetoflight.measurement.length import lengths
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.observations import Observations
from sheetoflight.simulation.poses import Recording, recorded
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from tests.calibration.boards import seen_boards
from tests.calibration.examples import two_lasers


def exact(rig: SimulatedRig) -> Calibration:
    return Calibration(
        method="joint",
        camera=rig.camera,
        light_planes=rig.light_planes,
        covariance=Covariance((), np.zeros((0, 0))),
        residuals=Residuals(0.0, 1.0),
        target=rig.target,
        pixel_std=0.1,
    )


def seen(rig: SimulatedRig, plane: int = 10, crossing: int = 0) -> Observations:
    recording = Recording(0, plane, crossing)
    return recorded(rig, recording, np.random.default_rng(3))


def test_segments_have_the_targets_length_and_lie_in_the_picture() -> None:
    rig = paper_rig()
    segments = field_segments(exact(rig), seen(rig))
    ends = np.array([segment.uv for segment in segments])
    assert [one.value for one in lengths(exact(rig), ends)] == pytest.approx([400.0] * len(ends))
    assert (ends >= -0.5).all()
    assert (ends <= np.array(rig.camera.image_size) - 0.5).all()
    assert {segment.name.split(" at ")[0] for segment in segments} == {
        "400 mm along u",
        "400 mm along v",
    }


def test_their_middles_lie_where_targets_were_seen() -> None:
    rig = paper_rig()
    views = seen(rig)
    low, high = views.plane.uv.min(axis=(0, 1)), views.plane.uv.max(axis=(0, 1))
    for segment in field_segments(exact(rig), views):
        middle = np.mean(exact(rig).triangulate(segment.uv), axis=0)
        assert (rig.camera.project(middle) > low).all()
        assert (rig.camera.project(middle) < high).all()


def test_too_long_a_target_is_halved_until_it_fits() -> None:
    rig = paper_rig()
    longer = replace(rig.target, markers_mm=(0.0, 800.0, 1600.0))
    segments = field_segments(replace(exact(rig), target=longer), seen(rig))
    assert {segment.name.split()[0] for segment in segments} == {"400"}


def test_every_laser_has_its_own_and_spots_are_enough() -> None:
    rig = two_lasers()
    segments = field_segments(exact(rig), seen(rig, plane=0, crossing=6))
    assert {segment.laser for segment in segments} == {"left", "right"}
    for plane in rig.light_planes:
        own = np.array([segment.uv for segment in segments if segment.laser == plane.name])
        found = lengths(exact(rig), own, laser=plane.name)
        assert len({round(one.value, 6) for one in found}) == 1


def test_a_boards_longest_side_where_its_lines_were() -> None:
    truth, views = seen_boards(np.random.default_rng(3), 6)
    known, board = replace(exact(truth), target=None), truth.board
    segments = field_segments(known, Observations(board=views), board)
    assert len(segments) >= 9
    low, high = views.line.uv.min(axis=0), views.line.uv.max(axis=0)
    for segment in segments:
        one, other = known.triangulate(segment.uv)
        halved = 200.0 * 0.5 ** np.arange(5)
        assert np.isclose(np.linalg.norm(other - one), halved).any()
        middle = truth.camera.project(((one + other) / 2.0)[None])[0]
        assert (middle > low).all()
        assert (middle < high).all()


def test_no_sheet_seen_or_no_scale_known_gives_none() -> None:
    rig = paper_rig()
    assert field_segments(exact(rig), Observations()) == ()
    assert field_segments(replace(exact(rig), target=None), seen(rig)) == ()
