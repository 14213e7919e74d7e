"""OpenCV's camera files: those its own FileStorage writes, and spellings seen in the wild."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.exchange import EXCHANGE_FORMATS, read_exchange, write_exchange
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane

ENDINGS = (".yml", ".xml", ".json")
K = np.array([[4e3 / 7, 0.0, 319.6], [0.0, 4.1e3 / 7, 241.3], [0.0, 0.0, 1.0]])
FIVE = np.array([-0.21, 1e-05, 1 / 3000, -2e-4, 0.013])


def stored(path: Path, **entries: object) -> Path:
    """A file by OpenCV's own writer."""
    storage = cv2.FileStorage(str(path), cv2.FileStorage_WRITE)
    for key, value in entries.items():
        storage.write(key, value)  # pyright: ignore[reportCallIssue, reportArgumentType]
    storage.release()
    return path


def sample(path: Path, distortion: np.ndarray = FIVE, **others: object) -> Path:
    """As OpenCV's sample calibration.cpp writes it."""
    return stored(
        path,
        calibration_time="Sun Nov 22 2026",
        image_width=640,
        image_height=480,
        camera_matrix=K,
        distortion_coefficients=distortion.reshape(-1, 1),
        avg_reprojection_error=0.2,
        **others,
    )


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_opencv_writes_is_read_to_the_last_digit(ending: str, tmp_path: Path):
    found = read_exchange(sample(tmp_path / f"camera{ending}"))
    assert found.format == "opencv"
    assert found.camera.image_size == (640, 480)
    np.testing.assert_array_equal(found.camera.matrix, K)
    np.testing.assert_array_equal(found.camera.distortion, FIVE)
    assert found.light_planes == ()


def test_its_rays_are_those_of_opencv(tmp_path: Path):
    camera = read_exchange(sample(tmp_path / "camera.yml")).camera
    rng = np.random.default_rng(1)
    uv = rng.uniform((150, 100), (490, 380), (200, 2))
    rays = cv2.undistortPoints(
        uv[:, None], K, FIVE, criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    )
    np.testing.assert_allclose(camera.unproject(uv)[:, :2], rays[:, 0], rtol=0, atol=1e-9)


def test_four_coefficients_leave_k3_at_zero(tmp_path: Path):
    found = read_exchange(sample(tmp_path / "c.yml", FIVE[:4]))
    assert found.camera.distortion == (*FIVE[:4], 0.0)


@pytest.mark.parametrize(("count", "model"), [(8, "rational"), (12, "thin prism"), (14, "tilt")])
def test_further_coefficients_are_refused_unless_they_are_zero(
    count: int, model: str, tmp_path: Path
):
    zero = np.append(FIVE, np.zeros(count - 5))
    assert read_exchange(sample(tmp_path / "zero.yml", zero)).camera.distortion == tuple(FIVE)
    zero[-1] = 1e-9
    with pytest.raises(InputError, match=f"distortion_coefficients has {count}.*{model}"):
        read_exchange(sample(tmp_path / "used.yml", zero))


def test_a_fisheye_lens_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="fisheye_model says a fisheye lens"):
        read_exchange(sample(tmp_path / "c.yml", FIVE[:4], fisheye_model=1))
    assert read_exchange(sample(tmp_path / "d.yml", fisheye_model=0)).camera.beta == K[1, 1]


SPELLINGS = [
    ("cameraMatrix", "distCoeffs"),
    ("CameraMatrix", "DistCoeffs"),
    ("Camera_Matrix", "Distortion_Coefficients"),
    ("camera_matrix", "dist_coeff"),
    ("K", "D"),
    ("M1", "D1"),
    ("mtx", "dist"),
    ("mat", "coef"),
]


@pytest.mark.parametrize(("matrix", "distortion"), SPELLINGS)
def test_other_spellings_in_plain_yaml(matrix: str, distortion: str, tmp_path: Path):
    """As Python programs dump it, without OpenCV's tags, and without the pictures' size."""
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump({matrix: K.tolist(), distortion: [FIVE.tolist()], "rms": 0.3}))
    with pytest.raises(InputError, match=r"camera\.yaml: the size of the pictures is not in it"):
        read_exchange(path)
    found = read_exchange(path, image_size=(640, 480))
    np.testing.assert_array_equal(found.camera.matrix, K)
    np.testing.assert_array_equal(found.camera.distortion, FIVE)
    assert any("rms" in note for note in found.notes)
    own = distortion == "Distortion_Coefficients"
    assert own or any("order k1, k2, p1, p2, k3" in note for note in found.notes)


def test_numbers_as_cpp_writes_them_are_numbers(tmp_path: Path):
    """YAML 1.1 takes 1e-05 for text, for want of a point."""
    path = tmp_path / "c.yaml"
    path.write_text("K: [1e3, 0, 320, 0, 1e+3, 240, 0, 0, 1]\nD: [-1e-05, 2E-3, 0, .5e-4, 0]\n")
    found = read_exchange(path, image_size=(640, 480))
    assert found.camera.distortion == (-1e-5, 2e-3, 0.0, 0.5e-4, 0.0)
    assert found.camera.alpha == 1000.0


def test_of_a_stereo_file_one_camera_has_to_be_chosen(tmp_path: Path):
    """As OpenCV's stereo_calib.cpp writes intrinsics.yml."""
    path = stored(tmp_path / "i.yml", M1=K, D1=FIVE, M2=2 * K - np.diag([0, 0, 1.0]), D2=-FIVE)
    with pytest.raises(InputError, match="2 cameras – say which is meant: 1 or 2"):
        read_exchange(path, image_size=(640, 480))
    second = read_exchange(path, image_size=(640, 480), camera="2").camera
    assert second.alpha == 2 * K[0, 0]
    assert second.distortion == tuple(-FIVE)
    with pytest.raises(InputError, match="there is no camera '3' – choose 1 or 2"):
        read_exchange(path, image_size=(640, 480), camera="3")


def test_a_size_that_disagrees_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="640 x 480 px by the file"):
        read_exchange(sample(tmp_path / "c.yml"), image_size=(1280, 960))


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_calibration_comes_back_as_it_was(ending: str, calibration: Calibration, tmp_path: Path):
    (plane,) = calibration.light_planes
    second = LightPlane(np.array([-0.9, 0.1, 0.4]), 480.0 / 7, "Ebene ö")
    two = replace(calibration, light_planes=(plane, second))
    notes = write_exchange(tmp_path / f"c{ending}", two, "opencv")
    found = read_exchange(tmp_path / f"c{ending}")
    np.testing.assert_array_equal(found.camera.parameters, two.camera.parameters)
    assert found.camera.image_size == two.camera.image_size
    for was, came in zip(two.light_planes, found.light_planes, strict=True):
        assert (came.name, came.distance_mm) == (was.name, was.distance_mm)
        np.testing.assert_allclose(came.normal, was.normal, rtol=1e-15)
    assert any("uncertainties" in note for note in notes)
    assert any("skew" in note for note in notes)


def test_opencv_reads_what_is_written(calibration: Calibration, tmp_path: Path):
    write_exchange(tmp_path / "c.yml", calibration, "opencv")
    storage = cv2.FileStorage(str(tmp_path / "c.yml"), cv2.FileStorage_READ)
    assert storage.getNode("image_width").real() == calibration.camera.image_size[0]
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), calibration.camera.matrix)
    plane = storage.getNode("light_planes").at(0)
    assert plane.getNode("name").string() == "laser"
    assert plane.getNode("distance_mm").real() == calibration.light_plane.distance_mm


@pytest.mark.parametrize("name", ["it's", "true", "a\nb", "x" * 5000, "\udc80"], ids=repr)
def test_a_name_that_opencv_cannot_say_is_refused_and_nothing_is_left(
    name: str, calibration: Calibration, tmp_path: Path
):
    plane = replace(calibration.light_plane, name=name)
    with pytest.raises(InputError, match=r"c\.yml: the light plane's name"):
        write_exchange(tmp_path / "c.yml", replace(calibration, light_planes=(plane,)), "opencv")
    assert list(tmp_path.iterdir()) == []


WRONG = {
    "a focal length below zero": ("K: [-1, 0, 3, 0, 1, 2, 0, 0, 1]\nD: [0, 0, 0, 0]", "K: "),
    "no number": ("K: [.nan, 0, 3, 0, 1, 2, 0, 0, 1]\nD: [0, 0, 0, 0]", r"K\[0\] is '.nan'"),
    "too few": ("K: [1, 0, 3]\nD: [0, 0, 0, 0]", "K has 3 numbers, expected 9"),
    "three coefficients": ("K: [1, 0, 3, 0, 1, 2, 0, 0, 1]\nD: [0, 0, 0]", "D has 3 coeff"),
    "twice": ("K: 1\nK: 2", "key 'K' is given twice"),
    "two names": ("K: 1\nmtx: 2", "K and mtx say the same thing"),
    "itself": ("K: &a [*a]", "holds itself"),
    "no matrix": ("K: {rows: 2, cols: 2, data: [1, 2, 3]}", "2 columns, and 3 numbers"),
    "another model": ("K: 1\ncamera_model: omni", "camera_model says 'omni'"),
    "nothing known": ("a: 1\nb: 2", "no camera is recognised"),
    "a list": ("- 1", "it holds a list of 1"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_named_with_the_file(wrong: str, tmp_path: Path):
    text, said = WRONG[wrong]
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"camera\.yaml: .*{said}"):
        read_exchange(path, image_size=(640, 480))


def test_text_that_is_no_yaml_names_the_line(tmp_path: Path):
    path = tmp_path / "camera.yaml"
    path.write_text("K: [1, 2\nD: 3\n")
    with pytest.raises(FileError, match=r"camera\.yaml: line 2 is not YAML"):
        read_exchange(path)


def test_entities_and_huge_files_are_refused(tmp_path: Path):
    xml = tmp_path / "c.xml"
    xml.write_text('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><opencv_storage/>')
    with pytest.raises(InputError, match="defines entities"):
        read_exchange(xml)
    huge = tmp_path / "c.yml"
    huge.write_text("a: 1\n" * 300_000)
    with pytest.raises(FileError, match="more than 1048576 bytes"):
        read_exchange(huge)


def test_the_own_calibration_is_no_foreign_file(calibration: Calibration, tmp_path: Path):
    calibration.save(tmp_path / "c.json")
    with pytest.raises(InputError, match="a calibration of this package"):
        read_exchange(tmp_path / "c.json")


def test_an_unknown_format_names_those_there_are(calibration: Calibration, tmp_path: Path):
    with pytest.raises(InputError, match=", ".join(EXCHANGE_FORMATS)):
        write_exchange(tmp_path / "c.txt", calibration, "matlab")
