"""``sol calibrate`` without a target, and the camera it gives held for a board."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.io.points_csv import write_points
from sheetoflight.io.rig_toml import write_rig_toml
from sheetoflight.model.camera import Camera
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.observations import Observations
from tests.calibration.boards import rig_of, seen_boards
from tests.calibration.tracks import CAMERA, TWO_AXES, carried, moving, scene, turning

Words = Callable[..., tuple[int, str, str]]


def folder_of(
    folder: Path, uv: np.ndarray, camera: Camera, distortion: str = "none", skew: str = "false"
) -> Path:
    """A rig folder that holds matches and nothing else."""
    folder.mkdir()
    size = list(camera.image_size)
    (folder / "rig.toml").write_text(
        f'[camera]\nimage_size = {size}\ndistortion = "{distortion}"\nskew = {skew}\n'
    )
    names = tuple(f"shot{view}" for view in range(len(uv)))
    write_points(folder / "points.csv", Observations(matches=PointMatches(names, uv)))
    return folder


@pytest.fixture
def turned(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    uv = turning(CAMERA, TWO_AXES, 100, rng)
    return folder_of(tmp_path / "turned", uv + 0.2 * rng.normal(size=uv.shape), CAMERA)


@pytest.fixture
def moved(tmp_path: Path) -> Path:
    rng = np.random.default_rng(2)
    uv = moving(CAMERA, *carried(5, rng), scene(60, rng))
    return folder_of(tmp_path / "moved", uv + 0.2 * rng.normal(size=uv.shape), CAMERA)


@pytest.mark.parametrize("method", ["rotating-camera", "moving-camera"])
def test_a_camera_comes_out_and_can_be_reported(
    method: str, turned: Path, moved: Path, tmp_path: Path, sol: Words
) -> None:
    folder = turned if method == "rotating-camera" else moved
    found = tmp_path / "camera.json"
    status, out, error = sol("calibrate", folder, "-o", found, "--method", method, "--json")
    assert status == 0
    told = json.loads(out)
    assert told["method"] == method
    assert told["light_planes"] == []
    for name in ("alpha", "beta", "u0", "v0"):
        off = told["camera"][name] - getattr(CAMERA, name)
        assert abs(off) < 5.0 * told["std"][f"camera.{name}"]
    assert "warning: the camera alone was calibrated: unknown points have no scale" in error
    status, out, _ = sol("calibrate", folder, "-o", found, "--method", method)
    assert status == 0
    assert "5 in stage match" in out if folder == moved else "6 in stage match" in out
    page = tmp_path / "report.html"
    assert sol("report", found, "-o", page)[0] == 0
    assert "noise of the matched image points" in page.read_text(encoding="utf-8")


def test_the_camera_is_held_for_a_board_and_its_uncertainty_carried_on(
    tmp_path: Path, sol: Words
) -> None:
    rng = np.random.default_rng(3)
    truth, views = seen_boards(rng, views=4, pixel_std=0.1, line_std=0.1)
    uv = turning(truth.camera, TWO_AXES, 80, rng)
    uv += 0.4 * rng.normal(size=uv.shape)
    own = folder_of(tmp_path / "turned", uv, truth.camera, "radial2")
    camera = tmp_path / "camera.json"
    assert sol("calibrate", own, "-o", camera, "--method", "rotating-camera")[0] == 0

    boards = tmp_path / "boards"
    boards.mkdir()
    rig = rig_of(truth, views)
    write_rig_toml(boards / "rig.toml", rig)
    write_points(boards / "points.csv", rig.observations, rig.lasers, rig.board)
    sheet = tmp_path / "sheet.json"
    status, out, _ = sol("calibrate", boards, "-o", sheet, "--camera", camera, "--json")
    assert status == 0
    told = json.loads(out)
    held, known = json.loads(sheet.read_text()), json.loads(camera.read_text())
    assert held["camera"] == known["camera"]
    (plane,) = held["light_planes"]
    off = plane["distance_mm"] - truth.light_planes[0].distance_mm
    assert abs(off) < 5.0 * told["std"]["laser.d"]
    shares = told["std_by_source"]["laser.d"]
    assert shares["known camera"] > 0.5 * told["std"]["laser.d"]
    places = [held["covariance"]["parameters"].index(f"camera.{n}") for n in ("alpha", "u0")]
    before = [known["covariance"]["parameters"].index(f"camera.{n}") for n in ("alpha", "u0")]
    kept = np.array(held["covariance"]["matrix"])[np.ix_(places, places)]
    assert np.allclose(kept, np.array(known["covariance"]["matrix"])[np.ix_(before, before)])


def expect_error(result: tuple[int, str, str], status: int, *said: str) -> None:
    found, out, error = result
    assert found == status, error
    assert not out
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    for words in said:
        assert words in error


def test_other_methods_say_which_to_use(turned: Path, tmp_path: Path, sol: Words) -> None:
    output = tmp_path / "c.json"
    for method in ("joint", "two-step", "paper"):
        result = sol("calibrate", turned, "-o", output, "--method", method)
        expect_error(result, 2, "--method rotating-camera", "--method moving-camera")
    assert not output.exists()


def test_the_wrong_kind_of_motion_is_refused(
    turned: Path, moved: Path, tmp_path: Path, sol: Words
) -> None:
    output = tmp_path / "c.json"
    words = ("-o", output, "--method")
    expect_error(sol("calibrate", turned, *words, "moving-camera"), 3, "no pair of views shows")
    expect_error(sol("calibrate", moved, *words, "rotating-camera"), 3, "or use moving-camera")
    assert not output.exists()


def test_turns_that_leave_the_camera_open_are_refused(tmp_path: Path, sol: Words) -> None:
    rng = np.random.default_rng(4)
    words = ("-o", tmp_path / "c.json", "--method", "rotating-camera")
    pans = turning(CAMERA, [[0, a, 0] for a in (0.0, 0.2, -0.2, 0.1)], 80, rng)
    pans += 0.3 * rng.normal(size=pans.shape)
    panned = folder_of(tmp_path / "panned", pans, CAMERA, skew="true")
    expect_error(sol("calibrate", panned, *words), 3, "about one axis", "about two axes")
    rolls = turning(CAMERA, [[0, 0, a] for a in (0.0, 0.2, -0.2, 0.4)], 60, rng)
    rolled = folder_of(tmp_path / "rolled", rolls + 0.2 * rng.normal(size=rolls.shape), CAMERA)
    expect_error(sol("calibrate", rolled, *words), 3, "about the line of sight alone")
    slight = turning(CAMERA, [[0, a, 0] for a in (0.0, 0.0003, -0.0003)], 60, rng)
    hardly = folder_of(tmp_path / "hardly", slight + 0.3 * rng.normal(size=slight.shape), CAMERA)
    expect_error(sol("calibrate", hardly, *words), 3, "about two axes")


def test_what_goes_with_no_target_only_is_refused(turned: Path, tmp_path: Path, sol: Words) -> None:
    words = ("calibrate", turned, "-o", tmp_path / "c.json", "--method", "rotating-camera")
    expect_error(sol(*words, "--monte-carlo", 100), 2, "method rotating-camera has none")
    assert sol(*words)[0] == 0
    known = ("--camera", tmp_path / "c.json")
    again = ("calibrate", turned, "-o", tmp_path / "d.json", "--method", "rotating-camera")
    expect_error(sol(*again, *known), 2, "leave out --camera")


def test_a_damaged_table_is_named_with_its_line(turned: Path, tmp_path: Path, sol: Words) -> None:
    table = turned / "points.csv"
    lines = table.read_text().splitlines()
    lines[6] = lines[6].replace(",match,", ",match,x")
    table.write_text("\n".join(lines) + "\n")
    result = sol("calibrate", turned, "-o", tmp_path / "c.json", "--method", "rotating-camera")
    expect_error(result, 2, "points.csv line 7", "marker is 'x")


def test_without_points_there_is_nothing_to_look_for(turned: Path, sol: Words) -> None:
    (turned / "points.csv").unlink()
    expect_error(sol("calibrate", turned), 2, "neither [target] nor [board] is there")
    expect_error(sol("detect", turned), 2, "neither [target] nor [board] is there")
    expect_error(sol("plan", turned), 2, "neither [target] nor [board] is there")


def test_the_same_matches_give_the_same_bytes(turned: Path, tmp_path: Path, sol: Words) -> None:
    for name in ("one.json", "two.json"):
        words = ("-o", tmp_path / name, "--method", "rotating-camera")
        assert sol("calibrate", turned, *words)[0] == 0
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()
