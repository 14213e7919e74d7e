"""Lengths from files: each in the sheet of its laser, by the name that all outputs give it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.pictures import list_pictures, read_picture
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.workflow.measured import (
    length_row,
    measure_pictures,
    measure_segments,
    piece_lengths,
)
from sheetoflight.workflow.rig_folder import detect
from sheetoflight.workflow.simulated import SimulationOptions, simulate
from sheetoflight.workflow.verified import verify
from tests.known_lengths import RIG, calibrated, true_ends

BARS_MM = [150.0, 300.0]
OTHER = LightPlane(np.array([-0.88, 0.1, 0.46]), 610.0, "other")
TWO = replace(calibrated(), light_planes=(RIG.light_plane, OTHER))
ENDS = true_ends([150.0, 300.0, 450.0])


def table(path: Path, lasers: list[str]) -> Path:
    rows = [
        ",".join([f"s{number}", *map(repr, uv.ravel().tolist()), laser])
        for number, (uv, laser) in enumerate(zip(ENDS, lasers, strict=True))
    ]
    path.write_text("\n".join(["segment,u1,v1,u2,v2,laser", *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def bars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two bars, rendered; not to be changed."""
    folder = tmp_path_factory.mktemp("bars") / "rig"
    simulate(folder, SimulationOptions(camera_views=1, plane_views=1, bars_mm=BARS_MM, clutter=0))
    return folder


def test_each_segment_is_measured_in_the_sheet_of_its_laser(tmp_path: Path) -> None:
    found = measure_segments(TWO, table(tmp_path / "s.csv", ["other", "laser", "other"]))
    assert [one.name for one in found] == ["s0", "s1", "s2"]
    assert [one.laser for one in found] == ["other", "laser", "other"]
    for one, ends in zip(found, ENDS, strict=True):
        assert np.array_equal(one.ends, ends)
        assert one.length.value == pytest.approx(TWO.length(*ends, laser=one.laser).value)
        assert one.length.std == pytest.approx(TWO.length(*ends, laser=one.laser).std)
    assert found[1].length.value == pytest.approx(300.0, abs=1e-6)
    assert length_row(found[1])[0] == "s1"


def test_a_laser_may_be_named_for_all_that_name_none(tmp_path: Path) -> None:
    path = table(tmp_path / "s.csv", ["", "other", ""])
    found = measure_segments(TWO, path, "laser")
    assert [one.laser for one in found] == ["laser", "other", "laser"]
    with pytest.raises(InputError, match=r"segment 's0' names no laser.* has laser and other"):
        measure_segments(TWO, path)
    with pytest.raises(InputError, match=r"segment 's0' lies on the laser 'up', .* choose laser"):
        measure_segments(TWO, path, "up")


def test_pictures_are_measured_in_the_sheet_that_is_named(bars: Path, tmp_path: Path) -> None:
    files = list_pictures(bars / "measure")
    named = measure_pictures(TWO, files, laser="laser")
    alone = measure_pictures(calibrated(), files)
    for picture, single, true_mm in zip(named, alone, BARS_MM, strict=True):
        (one,), (other,) = picture.segments, single.segments
        assert one.length == other.length
        assert one.length.value == pytest.approx(true_mm, abs=0.5)
        assert (picture.laser, one.laser) == ("laser", "laser")
    with pytest.raises(InputError, match=r"lasers laser and other.*--laser"):
        measure_pictures(TWO, files)
    with pytest.raises(InputError, match=r"no laser 'up'"):
        measure_pictures(TWO, files, laser="up")
    TWO.save(tmp_path / "two.json")
    found = verify(tmp_path / "two.json", [bars / "measure" / "bar00_on.png"], 150, laser="laser")
    assert found.comparisons[0].segment.laser == "laser"


def test_pieces_without_a_length_do_not_count() -> None:
    def piece(ends: np.ndarray, whole: bool) -> LinePiece:
        return LinePiece(ends, np.full(2, 0.1), ends, np.full(2, 0.1), whole)

    some = (piece(ENDS[0], False), piece(ENDS[0], True), piece(ENDS[1], True))
    found = piece_lengths(calibrated(), "bar", some)
    assert [one.name for one in found] == ["bar-1", "bar-2"]
    assert [one.length.value for one in found] == pytest.approx([150.0, 300.0], abs=1e-6)
    assert [one.name for one in piece_lengths(calibrated(), "bar", some[:2])] == ["bar"]
    assert piece_lengths(calibrated(), "bar", some[:1]) == ()


def cropped(path: Path) -> None:
    cv2.imwrite(str(path), read_picture(path)[:-10])


@pytest.mark.parametrize("half", ["on", "off"])
def test_both_pictures_of_a_pair_have_the_cameras_size(
    half: str, bars: Path, tmp_path: Path
) -> None:
    for path in (bars / "measure").glob("bar00_*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    cropped(tmp_path / f"bar00_{half}.png")
    with pytest.raises(InputError, match=rf"bar00_{half}\.png has 1392×1030 pixels"):
        measure_pictures(calibrated(), list_pictures(tmp_path))


def test_detection_wants_pairs_of_one_size(tmp_path: Path) -> None:
    simulate(tmp_path / "rig", SimulationOptions(1, 1, (), clutter=0))
    cropped(tmp_path / "rig" / "plane" / "plane00_on.png")
    with pytest.raises(InputError, match=r"plane00_on\.png has 1392×1030 .* plane00_off\.png has"):
        detect(tmp_path / "rig")
