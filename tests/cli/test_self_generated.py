"""``sol calibrate --method self-generated``, from a folder to lengths."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.io.points_csv import write_points
from sheetoflight.io.rig_toml import write_rig_toml
from sheetoflight.model.observations import Observations
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views
from tests.calibration.boards import rig_of, seen_boards, without_lines

Words = Callable[..., tuple[int, str, str]]
PLATE = SteppedPlate(edges_mm=(-100.0, 0.0, 100.0))


def plate_folder(folder: Path, truth: SimulatedRig, noise: str = "") -> Path:
    """A rig folder that holds a plate's points and nothing else."""
    folder.mkdir()
    views = stepped_plate_views(truth, PLATE, np.random.default_rng(4), 0.1)
    size = list(truth.camera.image_size)
    (folder / "rig.toml").write_text(f"[camera]\nimage_size = {size}\n{noise}")
    write_points(folder / "points.csv", Observations(board=views))
    return folder


@pytest.fixture
def camera_and_plate(tmp_path: Path, sol: Words) -> tuple[Path, Path, SimulatedRig]:
    """A camera from boards without a line, and a plate's folder."""
    truth, views = seen_boards(np.random.default_rng(3), 8, 0.1)
    boards = tmp_path / "boards"
    boards.mkdir()
    rig = rig_of(truth, without_lines(views))
    write_rig_toml(boards / "rig.toml", rig)
    write_points(boards / "points.csv", rig.observations, rig.lasers, rig.board)
    assert sol("calibrate", boards, "-o", tmp_path / "camera.json")[0] == 0
    return tmp_path / "camera.json", plate_folder(tmp_path / "rig", truth), truth


def test_a_plate_is_calibrated_reported_and_measured_with(
    camera_and_plate: tuple[Path, Path, SimulatedRig], tmp_path: Path, sol: Words
) -> None:
    """Distance and lengths are within five of their standard uncertainties, which chance passes
    once in two million."""
    camera, rig, truth = camera_and_plate
    found = tmp_path / "c.json"
    words = ("calibrate", rig, "-o", found, "--method", "self-generated", "--camera", camera)
    status, out, error = sol(*words, "--json")
    assert (status, error) == (0, "")
    told = json.loads(out)
    assert told["method"] == "self-generated"
    off = told["light_plane"]["distance_mm"] - truth.light_plane.distance_mm
    assert abs(off) < 5 * told["std"]["laser.d"] < 10
    assert set(told["std_by_source"]["laser.d"]) == {"board", "known camera"}
    held, known = (json.loads(path.read_text()) for path in (found, camera))
    assert held["camera"] == known["camera"]
    assert held["provenance"]["known_camera"] is True

    status, out, _ = sol(*words)
    assert status == 0
    assert "5 in stage board" in out
    assert sol("report", found, "-o", tmp_path / "report.html")[0] == 0

    corners = truth.camera.project(PLATE.points(truth)[:, [0, -1]]).reshape(-1, 4)
    rows = [",".join([f"s{k}", *map(repr, row)]) for k, row in enumerate(corners.tolist())]
    (tmp_path / "segments.csv").write_text("\n".join(["segment,u1,v1,u2,v2", *rows]) + "\n")
    lengths = tmp_path / "lengths.csv"
    assert sol("measure", found, tmp_path / "segments.csv", "-o", lengths)[0] == 0
    for row in lengths.read_text().splitlines()[1:]:
        _, length, std, *_ = row.split(",")
        assert abs(float(length) - 200.0) < 5 * float(std)
        assert float(std) < 1.0


def test_the_camera_is_asked_for_and_other_methods_say_which_one_uses_places(
    camera_and_plate: tuple[Path, Path, SimulatedRig], tmp_path: Path, sol: Words
) -> None:
    camera, rig, _ = camera_and_plate
    words = ("calibrate", rig, "-o", tmp_path / "c.json")
    status, _, error = sol(*words, "--method", "self-generated")
    assert status == 2
    assert "needs a camera that is known" in error
    for method in ("joint", "two-step", "camera-free", "planar-lines"):
        for known in ((), ("--camera", camera)):
            status, _, error = sol(*words, "--method", method, *known)
            assert status == 2
            assert error.count("\n") == 1
            assert "use --method self-generated with --camera FILE" in error
    status, _, error = sol(
        *words, "--method", "self-generated", "--camera", camera, "--monte-carlo", "100"
    )
    assert status == 2
    assert "method self-generated has none" in error
    assert not (tmp_path / "c.json").exists()
