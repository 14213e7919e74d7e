"""``sol calibrate`` by the older methods for boards, from a folder to a file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.cli.main import main
from sheetoflight.io.points_csv import write_points
from sheetoflight.io.rig_toml import write_rig_toml
from sheetoflight.model.board import Board
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.boards import rig_of, seen_boards


def folder_of(folder: Path, board: Board | None = None) -> SimulatedRig:
    """A rig folder with detections, and the truth behind it."""
    truth, views = seen_boards(np.random.default_rng(21), 10, 0.05, 0.05, board, 80)
    rig = rig_of(truth, views)
    folder.mkdir()
    write_rig_toml(folder / "rig.toml", rig)
    write_points(folder / "points.csv", rig.observations, rig.lasers, rig.board)
    return truth


@pytest.mark.parametrize(
    ("method", "board"),
    [("planar-lines", None), ("cross-ratio", None), ("zigzag", folded_body())],
    ids=["planar-lines", "cross-ratio", "zigzag"],
)
def test_a_folder_is_calibrated(
    method: str, board: Board | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The distance is within five of its standard uncertainties: else once in two million."""
    truth = folder_of(tmp_path / "rig", board)
    found = tmp_path / "c.json"
    words = ["calibrate", str(tmp_path / "rig"), "-o", str(found), "--method", method, "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["method"] == method
    off = told["light_plane"]["distance_mm"] - truth.light_plane.distance_mm
    assert abs(off) < 5 * told["std"]["laser.d"]
    assert 0 < told["std"]["laser.d"] < 3
    assert {"board", "line"} <= set(told["std_by_source"]["laser.d"])
    assert json.loads(found.read_text())["method"] == method


def test_a_camera_from_a_file_is_held(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder_of(tmp_path / "rig")
    camera, found = tmp_path / "camera.json", tmp_path / "c.json"
    assert main(["calibrate", str(tmp_path / "rig"), "-o", str(camera)]) == 0
    words = ["calibrate", str(tmp_path / "rig"), "-o", str(found), "--camera", str(camera)]
    assert main([*words, "--method", "planar-lines"]) == 0
    assert "known camera" in capsys.readouterr().out
    one, other = (json.loads(path.read_text())["camera"] for path in (camera, found))
    assert one == other


def test_a_target_without_ridges_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of(tmp_path / "rig")
    words = ["calibrate", str(tmp_path / "rig"), "-o", str(tmp_path / "c.json")]
    assert main([*words, "--method", "zigzag"]) == 3
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("error: ")
    assert "has no ridge – use --method planar-lines" in said
    assert not (tmp_path / "c.json").exists()
