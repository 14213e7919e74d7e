"""``sol convert``: to every format and back, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.io import savemat

from sheetoflight.io.calibration_json import read_calibration
from sheetoflight.io.exchange import read_exchange
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import Camera
from tests.cli.laser_pictures import CAMERA, SHEET, Words, calibration, expect_error, sol

__all__ = ["sol"]

OUTPUTS = {
    "opencv": ("c.yml", "opencv"),
    "xml": ("c.xml", None),
    "ros": ("c.yaml", "ros"),
    "kalibr": ("c.yaml", "kalibr"),
    "halcon": ("c.dat", None),
    "bouguet": ("c.mat", None),
}


@pytest.fixture
def known(tmp_path: Path) -> Path:
    calibration().save(tmp_path / "calibration.json")
    return tmp_path / "calibration.json"


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_calibration_is_written_in_every_format(
    name: str, known: Path, tmp_path: Path, sol: Words
) -> None:
    file, to = OUTPUTS[name]
    status, out, err = sol("convert", known, tmp_path / file, *(("--to", to) if to else ()))
    assert (status, out.startswith("calibration.json written to")) == (0, True)
    assert "warning: the uncertainties of camera and light plane have no place in it" in err
    found = read_exchange(tmp_path / file)
    np.testing.assert_allclose(found.camera.parameters, CAMERA.parameters, rtol=1e-14)


def test_from_halcon_with_a_pose_to_a_length(known: Path, tmp_path: Path, sol: Words) -> None:
    """The way of a user who comes from HALCON: what is then measured is what HALCON's camera
    and plane say, by the distance of the sheet's own points."""
    assert sol("convert", known, tmp_path / "campar.dat")[0] == 0
    pose = tmp_path / "lightplane.dat"
    angle = float(np.degrees(np.arctan2(SHEET.normal[0], SHEET.normal[2])))
    x, y, z = (SHEET.normal * SHEET.distance_mm / 1000).tolist()
    pose.write_text(f"f 0\nr 0 {angle!r} 0\nt {x!r} {y!r} {z!r}\n")
    words = (tmp_path / "campar.dat", tmp_path / "new.json", "--pose", pose)
    expect_error(sol("convert", *words), 2, "campar.dat", "--pixel-std")
    status, _, err = sol("convert", *words, "--pixel-std", "0.2")
    assert status == 0
    assert "no uncertainty" in err
    found = read_calibration(tmp_path / "new.json")
    assert (found.method, found.pixel_std) == ("imported", 0.2)
    np.testing.assert_allclose(found.light_plane.normal, SHEET.normal, atol=1e-12)
    ends = np.array([[20.0, -30.0], [40.0, 60.0]])
    points = SHEET.intersect(CAMERA.unproject(ends + 90))
    length = found.length(*CAMERA.project(points))
    assert length.value == pytest.approx(np.linalg.norm(points[1] - points[0]), rel=1e-9)
    assert length.std > 0


def test_json_says_what_came_of_it(known: Path, tmp_path: Path, sol: Words) -> None:
    status, out, err = sol("convert", known, tmp_path / "c.yaml", "--to", "ros", "--json")
    told = json.loads(out)
    assert (status, err) == (0, "")
    assert (told["from"], told["to"]) == ("calibration.json", "ros")
    assert any("light plane" in note for note in told["notes"])


def test_a_file_without_a_size_needs_one(tmp_path: Path, sol: Words) -> None:
    """As many Python programs leave it: K and dist, no more."""
    plain = tmp_path / "camera.yaml"
    plain.write_text("K: [500, 0, 98, 0, 495, 81, 0, 0, 1]\ndist: [-0.1, 0.01, 0, 0, 0]\n")
    expect_error(sol("convert", plain, tmp_path / "c.xml"), 2, "camera.yaml", "image_size")
    status, _, _ = sol("convert", plain, tmp_path / "c.xml", "--image-size", 200, 160)
    assert status == 0
    storage = cv2.FileStorage(str(tmp_path / "c.xml"), cv2.FileStorage_READ)
    assert storage.getNode("image_height").real() == 160
    assert storage.getNode("distortion_coefficients").mat().ravel().tolist() == [
        -0.1,
        0.01,
        0,
        0,
        0,
    ]
    expect_error(
        sol("convert", tmp_path / "c.xml", tmp_path / "c.json", "--pixel-std", 0.1),
        2,
        "c.xml holds a camera and no light plane",
    )
    assert not (tmp_path / "c.json").exists()


def test_an_ending_of_several_formats_needs_a_choice(
    known: Path, tmp_path: Path, sol: Words
) -> None:
    expect_error(sol("convert", known, tmp_path / "c.yaml"), 2, "'.yaml' is the ending of opencv")
    expect_error(sol("convert", known, tmp_path / "c.txt"), 2, "'.txt' is the ending of no format")
    expect_error(sol("convert", known, tmp_path / "c.json"), 2, "--to opencv")
    expect_error(sol("convert", known, tmp_path / "c.png", "--to", "opencv"), 2, "writes no '.png'")


def test_what_does_not_belong_together_is_refused(known: Path, tmp_path: Path, sol: Words) -> None:
    expect_error(sol("convert", known, known, "--to", "opencv"), 2, "is also an input")
    expect_error(
        sol("convert", known, tmp_path / "c.dat", "--image-size", 1, 1), 2, "leave --image-size"
    )
    expect_error(sol("convert", tmp_path / "no.yaml", tmp_path / "c.dat"), 2, "does not exist")
    expect_error(sol("convert", known, tmp_path / "c.dat", "--pixel-um", 0), 2, "pixel_um is 0")


def test_a_camera_that_cannot_be_held_leaves_nothing(tmp_path: Path, sol: Words) -> None:
    strong = Camera((640, 480), 400.0, 400.0, 320.0, 240.0, 0.0, (-0.35, 0.15, 0.0, 0.0, 0.0))
    bent: Calibration = replace(calibration(), camera=strong)
    bent.save(tmp_path / "c.json")
    expect_error(sol("convert", tmp_path / "c.json", tmp_path / "c.dat"), 2, "c.dat: ", "0.5 px")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.json"]


def toolbox_corners(path: Path) -> Camera:
    """``calib_data.mat`` as Bouguet's toolbox saves it, of twelve views by OpenCV's projection:
    corners along x from the last row to the first, one view of fewer squares, one switched off."""
    rng = np.random.default_rng(8)
    camera = Camera((640, 480), 700.0, 702.0, 326.0, 233.0, 0.0, (-0.15, 0.08, 0.0, 0.0, 0.0))
    x, y = np.meshgrid(np.arange(9.0), np.arange(7.0)[::-1])
    board = 25.0 * np.stack([x.ravel(), y.ravel(), np.zeros(63)])
    variables: dict[str, object] = {"nx": 640.0, "ny": 480.0, "n_ima": 12.0, "dX": 25.0, "dY": 25.0}
    variables["active_images"] = np.where(np.arange(12) == 4, 0.0, 1.0)[None]
    for k in range(1, 13):
        shown = board[:, (board[0] < 150.0)] if k == 3 else board
        turn, _ = cv2.Rodrigues(rng.uniform(-0.6, 0.6, 3))
        middle = np.array([rng.uniform(-60, 60), rng.uniform(-40, 40), rng.uniform(480, 580)])
        at = middle - turn @ np.array([100.0, 75.0, 0.0])
        uv, _ = cv2.projectPoints(shown.T, turn, at, camera.matrix, np.array(camera.distortion))
        wrong = 30.0 if k == 5 else 0.0
        variables[f"X_{k}"] = shown
        variables[f"x_{k}"] = uv[:, 0].T + rng.normal(0.0, 0.1 + wrong, (2, shown.shape[1]))
    savemat(path, variables)
    return camera


def test_from_the_toolboxs_corners_to_a_camera(tmp_path: Path, sol: Words) -> None:
    """The way of a user who comes from Bouguet's toolbox: rig.toml is what the command says, and
    the camera is the true one, within four standard uncertainties."""
    truth = toolbox_corners(tmp_path / "calib_data.mat")
    folder = tmp_path / "rig"
    folder.mkdir()
    status, out, err = sol("convert", tmp_path / "calib_data.mat", folder / "points.csv")
    assert status == 0
    assert "warning: corners alone give a camera" in err
    first, _, needed = out.partition("rig.toml needs:\n")
    assert f"{10 * 63 + 42} corners in 11 views" in first
    (folder / "rig.toml").write_text(needed)
    status, out, err = sol("calibrate", folder, "-o", tmp_path / "c.json", "--json")
    assert (status, "left out" in err) == (0, False)
    found = json.loads(out)
    for name, true in zip(Camera.PARAMETERS, truth.parameters.tolist(), strict=True):
        if f"camera.{name}" in found["std"]:
            off = found["camera"][name] - true
            assert abs(off) < 4.0 * found["std"][f"camera.{name}"], name
    assert found["std"]["camera.alpha"] < 2.0
    assert found["noise_std"]["corner"] == pytest.approx(0.1, rel=0.15)


def test_what_the_toolboxs_corners_say_of_the_board(tmp_path: Path, sol: Words) -> None:
    toolbox_corners(tmp_path / "data.mat")
    status, out, err = sol("convert", tmp_path / "data.mat", tmp_path / "corners.csv", "--json")
    told = json.loads(out)
    assert (status, err) == (0, "")
    assert told["board"] == {
        "kind": "chessboard",
        "columns": 9,
        "rows": 7,
        "pitch_mm": [25.0, 25.0],
    }
    assert told["image_size"] == [640, 480]
    assert "4" in told["views"]
    assert "5" not in told["views"]
    square = np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 2.0, 2.0], [0.0, 0.0, 0.0, 0.0]])
    savemat(tmp_path / "old.mat", {"x_1": 10.0 * square[:2], "X_1": square})
    _, out, _ = sol("convert", tmp_path / "old.mat", tmp_path / "old.csv")
    assert "pitch_mm = [1.0, 2.0]" in out
    assert "# image_size = [width, height]: the file does not say it" in out


def test_corners_that_cannot_be_written_are_refused(
    known: Path, tmp_path: Path, sol: Words
) -> None:
    data = tmp_path / "data.mat"
    toolbox_corners(data)
    points = tmp_path / "points.csv"
    expect_error(
        sol("convert", known, points), 2, "calibration.json is no MATLAB file", "calib_data"
    )
    expect_error(sol("convert", data, points, "--pixel-std", 0.1), 2, "leave --image-size")
    expect_error(sol("convert", data, points, "--to", "opencv"), 2, "data.mat: ")
    assert sol("convert", known, tmp_path / "camera.mat")[0] == 0
    expect_error(sol("convert", tmp_path / "camera.mat", points), 2, "no corners in it", "x_1, X_1")
    assert not points.exists()
    points.write_text("view,stage,marker,u,v\n")
    expect_error(sol("convert", data, points), 2, "belongs to a rig folder")


def test_the_help_shows_an_example(sol: Words) -> None:
    status, out, _ = sol("convert", "--help")
    assert status == 0
    assert "sol convert calibration.json camera.yaml --to ros" in " ".join(out.split())
