"""ROS and Kalibr: files as their documentation and users show them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from sheetoflight.errors import InputError
from sheetoflight.io.exchange import read_exchange, write_exchange
from sheetoflight.model.calibration import Calibration

# hand_eye_calibration of ethz-asl, issue 76: what ROS's camera_calibration writes
ASTRA = """image_width: 640
image_height: 480
camera_name: rgb_Astra_Orbbec
camera_matrix:
  rows: 3
  cols: 3
  data: [526.6908296825479, 0, 312.3333507245396, 0, 525.7542623070541, 246.2279496394374, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.01864117263397289, -0.0807953154457166, 0.0006701578887838996, -0.001800282263098739, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [516.2001953125, 0, 310.3634868958034, 0, 0, 514.0494995117188, 246.8852026000968, 0, 0, 0,
    1, 0]
"""

# the same message as `ros2 topic echo` prints it
ECHO = """header:
  stamp:
    sec: 0
    nanosec: 0
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d:
- 0.01864117263397289
- -0.0807953154457166
- 0.0006701578887838996
- -0.001800282263098739
- 0.0
k: [526.6908296825479, 0.0, 312.3333507245396, 0.0, 525.7542623070541, 246.2279496394374, 0, 0, 1]
r: [1, 0, 0, 0, 1, 0, 0, 0, 1]
p: [516.2, 0, 310.3, 0, 0, 514.0, 246.8, 0, 0, 0, 1, 0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
---
"""

# the Kalibr wiki's page "yaml formats"
CHAIN = """cam0:
  camera_model: pinhole
  intrinsics: [461.629, 460.152, 362.680, 246.049]
  distortion_model: radtan
  distortion_coeffs: [-0.27695497, 0.06712482, 0.00087538, 0.00011556]
  T_cam_imu:
  - [0.01779318, 0.99967549,-0.01822936, 0.07008565]
  - [-0.9998017, 0.01795239, 0.00860714,-0.01771023]
  - [0.00893160, 0.01807260, 0.99979678, 0.00399246]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: -8.121e-05
  rostopic: /cam0/image_raw
  resolution: [752, 480]
cam1:
  camera_model: omni
  intrinsics: [0.80065662, 833.006, 830.345, 373.850, 253.749]
  distortion_model: radtan
  distortion_coeffs: [-0.33518750, 0.13211436, 0.00055967, 0.00057686]
  resolution: [752, 480]
"""


def saved(folder: Path, text: str) -> Path:
    path = folder / "camera.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", [ASTRA, ECHO], ids=["parsers", "message"])
def test_a_camera_info_is_read_as_it_stands(text: str, tmp_path: Path):
    found = read_exchange(saved(tmp_path, text))
    assert found.format == "ros"
    camera = found.camera
    assert camera.image_size == (640, 480)
    assert (camera.alpha, camera.beta) == (526.6908296825479, 525.7542623070541)
    assert (camera.u0, camera.v0) == (312.3333507245396, 246.2279496394374)
    assert camera.distortion == (
        *(0.01864117263397289, -0.0807953154457166),
        *(0.0006701578887838996, -0.001800282263098739, 0.0),
    )
    assert any("projection" in note for note in found.notes)


ROS_WRONG = {
    "fisheye": ("plumb_bob", "equidistant", "distortion_model is 'equidistant'"),
    "binned": ("image_width: 640", "image_width: 640\nbinning_x: 2", "binning_x is 2"),
    "cut out": ("image_width: 640", "roi: {x_offset: 8}\nimage_width: 640", "roi.x_offset"),
    "uncalibrated": ("[526.6908296825479", "[0", "camera_matrix: the focal lengths are 0"),
    "no size": ("image_width: 640\n", "", "'image_width' is missing"),
    "half a row": ("image_height: 480", "image_height: 480.5", "expected a whole number"),
}


@pytest.mark.parametrize("wrong", ROS_WRONG)
def test_another_camera_info_is_refused(wrong: str, tmp_path: Path):
    old, new, said = ROS_WRONG[wrong]
    assert old in ASTRA
    with pytest.raises(InputError, match=rf"camera\.yaml: .*{said}"):
        read_exchange(saved(tmp_path, ASTRA.replace(old, new, 1)))


def test_a_rational_model_whose_further_coefficients_are_zero_is_the_plain_one(tmp_path: Path):
    text = ASTRA.replace("plumb_bob", "rational_polynomial").replace(
        "cols: 5\n  data: [0.01864117263397289, -0.0807953154457166, 0.0006701578887838996, "
        "-0.001800282263098739, 0]",
        "cols: 8\n  data: [0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0]",
    )
    assert read_exchange(saved(tmp_path, text)).camera.distortion == (0.1, 0.2, 0.3, 0.4, 0.5)
    with pytest.raises(InputError, match="rational model"):
        read_exchange(saved(tmp_path, text.replace("0.5, 0, 0, 0]", "0.5, 0, 0, 1e-3]")))


def test_ros_gives_the_camera_back(calibration: Calibration, tmp_path: Path):
    path = tmp_path / "camera.yaml"
    notes = write_exchange(path, calibration, "ros")
    assert any("light plane" in note for note in notes)
    found = read_exchange(path)
    np.testing.assert_array_equal(found.camera.parameters, calibration.camera.parameters)
    document = yaml.safe_load(path.read_text())
    assert document["distortion_model"] == "plumb_bob"
    projection = np.array(document["projection_matrix"]["data"]).reshape(3, 4)
    np.testing.assert_array_equal(projection[:, :3], calibration.camera.matrix)


def test_one_camera_of_a_chain(tmp_path: Path):
    path = saved(tmp_path, CHAIN)
    with pytest.raises(InputError, match="2 cameras – say which is meant: cam0 or cam1"):
        read_exchange(path)
    found = read_exchange(path, camera="cam0")
    assert found.format == "kalibr"
    assert found.camera.image_size == (752, 480)
    np.testing.assert_array_equal(
        found.camera.parameters,
        [461.629, 460.152, 0, 362.680, 246.049, -0.27695497, 0.06712482, 0.00087538, 0.00011556, 0],
    )
    assert any("T_cam_imu" in note for note in found.notes)


KALIBR_WRONG = {
    "omni": ("camera_model: pinhole", "camera_model: omni", "cam0.camera_model is 'omni'"),
    "equi": ("model: radtan", "model: equidistant", "distortion_model is 'equidistant'"),
    "three": ("[461.629, 460.152,", "[461.629,", "cam0.intrinsics has 3 numbers"),
    "five": ("0.00011556]", "0.00011556, 0]", "cam0.distortion_coeffs has 5 numbers"),
    "size": ("[752, 480]", "[752, 0]", "cam0.resolution is 752 x 0"),
    "missing": ("  resolution: [752, 480]\n", "", "'resolution' is missing"),
}


@pytest.mark.parametrize("wrong", KALIBR_WRONG)
def test_other_models_and_sizes_are_refused(wrong: str, tmp_path: Path):
    old, new, said = KALIBR_WRONG[wrong]
    with pytest.raises(InputError, match=said):
        read_exchange(saved(tmp_path, CHAIN.replace(old, new, 1)), camera="cam0")


def test_kalibr_gives_a_camera_without_skew_and_k3_back(calibration: Calibration, tmp_path: Path):
    camera = replace(calibration.camera, gamma=0.0, distortion=(-0.1, 1 / 3, 1e-17, 5e-324, 0.0))
    write_exchange(tmp_path / "c.yaml", replace(calibration, camera=camera), "kalibr")
    found = read_exchange(tmp_path / "c.yaml")
    np.testing.assert_array_equal(found.camera.parameters, camera.parameters)


def test_a_k3_is_fitted_by_the_others_to_within_what_is_stated(
    calibration: Calibration, tmp_path: Path
):
    """OpenCV projects rays over the whole picture by either set of coefficients."""
    camera = replace(
        calibration.camera,
        alpha=1500.0,
        beta=1510.0,
        gamma=0.0,
        distortion=(-0.15, 0.08, 5e-4, -3e-4, 0.02),
    )
    notes = write_exchange(tmp_path / "c.yaml", replace(calibration, camera=camera), "kalibr")
    (stated,) = (float(n.split()[-2]) for n in notes if n.startswith("largest difference"))
    close = read_exchange(tmp_path / "c.yaml").camera
    assert close.distortion[4] == 0.0
    rays = camera.unproject(np.mgrid[0:1392:40j, 0:1040:30j].reshape(2, -1).T)
    was, came = (
        cv2.projectPoints(rays, np.zeros(3), np.zeros(3), c.matrix, np.array(c.distortion))[0]
        for c in (camera, close)
    )
    apart = np.linalg.norm(was - came, axis=-1).max()
    assert 0.5 * stated < apart < 1.01 * stated + 1e-9
    assert stated < 0.5
