"""Bouguet's toolbox: its results and its corners, as SciPy writes MATLAB's variables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.exchange import read_bouguet_corners, read_exchange, write_exchange
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane

RESULTS: dict[str, Any] = {
    "fc": np.array([[657.46], [657.95]]),
    "cc": np.array([[302.92], [242.53]]),
    "alpha_c": 0.0031,
    "kc": np.array([[-0.25541], [0.12588], [-0.00013], [0.00005], [0.002]]),
    "nx": 640.0,
    "ny": 480.0,
    "fc_error": np.array([[0.35], [0.38]]),
    "n_ima": 20.0,
}


def results(folder: Path, **changed: Any) -> Path:
    path = folder / "Calib_Results.mat"
    variables = {k: v for k, v in (RESULTS | changed).items() if v is not None}
    savemat(path, variables)
    return path


def projected(points: np.ndarray) -> np.ndarray:
    """Image points by the formulas of the toolbox's project_points2."""
    a, b = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r2 = a**2 + b**2
    kc = RESULTS["kc"].ravel()
    radial = 1 + kc[0] * r2 + kc[1] * r2**2 + kc[4] * r2**3
    x = a * radial + 2 * kc[2] * a * b + kc[3] * (r2 + 2 * a**2)
    y = b * radial + kc[2] * (r2 + 2 * b**2) + 2 * kc[3] * a * b
    f, c = RESULTS["fc"].ravel(), RESULTS["cc"].ravel()
    return np.column_stack([f[0] * (x + RESULTS["alpha_c"] * y) + c[0], f[1] * y + c[1]])


def test_results_project_as_the_toolbox_does(tmp_path: Path):
    found = read_exchange(results(tmp_path))
    assert (found.format, found.camera.image_size) == ("bouguet", (640, 480))
    points = np.random.default_rng(1).uniform((-200, -150, 400), (200, 150, 600), (100, 3))
    np.testing.assert_allclose(found.camera.project(points), projected(points), rtol=1e-12)


def test_what_older_versions_leave_out_is_zero_and_said(tmp_path: Path):
    path = results(tmp_path, alpha_c=None, kc=RESULTS["kc"][:4], nx=None)
    with pytest.raises(InputError, match=r"Calib_Results\.mat: nx and ny are not in it"):
        read_exchange(path)
    found = read_exchange(path, image_size=(640, 480))
    assert found.camera.gamma == 0.0
    assert found.camera.distortion[4] == 0.0
    assert any("alpha_c" in note for note in found.notes)


def test_a_calibration_comes_back_as_it_was(calibration: Calibration, tmp_path: Path):
    second = LightPlane(np.array([-0.9, 0.1, 0.4]), 480.0 / 7, "Ebene ö")
    two = replace(calibration, light_planes=(calibration.light_plane, second))
    notes = write_exchange(tmp_path / "c.mat", two, "bouguet")
    assert any("uncertainties" in note for note in notes)
    found = read_exchange(tmp_path / "c.mat")
    np.testing.assert_allclose(found.camera.parameters, two.camera.parameters, rtol=1e-15)
    for was, came in zip(two.light_planes, found.light_planes, strict=True):
        assert (came.name, came.distance_mm) == (was.name, was.distance_mm)
        np.testing.assert_allclose(came.normal, was.normal, rtol=1e-15)


def test_matlab_finds_the_shapes_of_the_toolbox(calibration: Calibration, tmp_path: Path):
    write_exchange(tmp_path / "c.mat", calibration, "bouguet")
    found = loadmat(tmp_path / "c.mat")
    assert found["fc"].shape == found["cc"].shape == (2, 1)
    assert found["kc"].shape == (5, 1)
    np.testing.assert_array_equal(found["KK"], calibration.camera.matrix)


def test_the_same_calibration_gives_the_same_bytes(calibration: Calibration, tmp_path: Path):
    """MATLAB's header has room for the time of writing; it is not used."""
    write_exchange(tmp_path / "a.mat", calibration, "bouguet")
    data = (tmp_path / "a.mat").read_bytes()
    assert data[:116] == b"MATLAB 5.0 MAT-file, written by sheetoflight".ljust(116)
    write_exchange(tmp_path / "b.mat", calibration, "bouguet")
    assert (tmp_path / "b.mat").read_bytes() == data


WRONG = {
    "fc": (np.array([[657.0], [-1.0]]), "focal lengths are 657.0 and -1.0"),
    "cc": (np.array([[np.nan], [1.0]]), "cc.* finite number"),
    "kc": (np.zeros((6, 1)), "kc has 6 coefficients"),
    "alpha_c": ("skew", "alpha_c is no matrix of real numbers"),
    "nx": (640.5, "expected a whole number"),
    "ny": (np.zeros((2, 2)), "ny has 4 numbers"),
}


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_variable_is_named(key: str, tmp_path: Path):
    value, said = WRONG[key]
    with pytest.raises(InputError, match=rf"Calib_Results\.mat: .*{said}"):
        read_exchange(results(tmp_path, **{key: value}))


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["f8", "f4", "i4", "u1", "i2", "u8", "?"])
def test_numbers_of_every_kind_are_read(kind: str, compressed: bool, tmp_path: Path):
    """MATLAB stores whole numbers in as few bytes as hold them; so does SciPy."""
    size = np.array([[640.0, 480.0]]) if kind not in ("u1", "?") else np.array([[1.0, 1.0]])
    path = tmp_path / "c.mat"
    sides = {"nx": size[:, :1].astype(kind), "ny": size[:, 1:].astype(kind)}
    savemat(path, RESULTS | sides, do_compression=compressed)
    found = read_exchange(path)
    assert found.camera.image_size == tuple(size[0])
    assert found.camera.alpha == RESULTS["fc"][0, 0]


def test_other_versions_are_refused(tmp_path: Path):
    path = tmp_path / "c.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(600))
    with pytest.raises(FileError, match=r"no MATLAB file of version 5.*save -v6"):
        read_exchange(path)


# --- corners --------------------------------------------------------------------------------------

PITCH = 30.0


def board(columns: int, rows: int) -> np.ndarray:
    """``(3, N)`` in the toolbox's order: along x, from the last row to the first."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows)[::-1])
    return PITCH * np.stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def seen(number: int, points: np.ndarray) -> np.ndarray:
    """An image point for each board point that tells view and point apart."""
    return np.stack([points[0] + 0.1 * number, points[1] + 0.2 * number]) + 100.0


def corners(folder: Path, **changed: Any) -> Path:
    whole, part = board(4, 3), board(2, 3)
    nothing = {"x_3": np.full((2, 1), np.nan), "X_3": np.full((3, 1), np.nan)}
    variables = {
        "active_images": np.array([[1.0, 1.0, 1.0, 0.0, 1.0]]),
        "x_1": seen(1, whole),
        "X_1": whole,
        "x_2": seen(2, part),
        "X_2": part,
        "x_4": seen(4, whole),
        "X_4": whole,
        "x_5": seen(5, whole)[:, ::-1],
        "X_5": whole[:, ::-1],
        "calib_name": "image",
    }
    path = folder / "calib_data.mat"
    savemat(path, variables | nothing | changed)
    return path


def test_every_corner_keeps_its_board_point(tmp_path: Path):
    """Whatever part of the board a view shows, and in whatever order."""
    points, views = read_bouguet_corners(corners(tmp_path))
    np.testing.assert_array_equal(points, board(4, 3).T)
    assert views.names == ("1", "2", "5")
    for row, number in enumerate((1, 2, 5)):
        expected = seen(number, points.T).T
        if number == 2:
            expected[points[:, 0] > PITCH] = np.nan
        np.testing.assert_allclose(views.uv[row], expected, rtol=1e-14)


def test_a_single_corner_may_be_missing(tmp_path: Path):
    uv = seen(1, board(4, 3))
    uv[:, 5] = np.nan
    points, views = read_bouguet_corners(corners(tmp_path, x_1=uv))
    place = np.flatnonzero((points == board(4, 3)[:, 5]).all(axis=1))
    assert (~views.seen[0]).nonzero()[0].tolist() == place.tolist()


CORNERS_WRONG = {
    "another count": ({"X_2": board(2, 2)}, "x_2 is 2 x 6 and X_2 3 x 4"),
    "no board point": ({"X_1": np.full((3, 12), np.nan)}, "X_1 has no number"),
    "twice": ({"X_1": np.zeros((3, 12))}, "X_1 holds a board point twice"),
    "text": ({"x_1": "text"}, "x_1 is no matrix of real numbers"),
    "none": ({"active_images": np.zeros((1, 5))}, "no corners in it"),
}


@pytest.mark.parametrize("wrong", CORNERS_WRONG)
def test_wrong_corners_are_named(wrong: str, tmp_path: Path):
    changed, said = CORNERS_WRONG[wrong]
    with pytest.raises(InputError, match=rf"calib_data\.mat: .*{said}"):
        read_bouguet_corners(corners(tmp_path, **changed))
