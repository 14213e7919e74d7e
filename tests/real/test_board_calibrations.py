"""Other people's photographs of boards, calibrated with nothing set but the board's geometry."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from bench.photographs import left_out_heights
from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.model.calibration import Calibration
from sheetoflight.workflow.calibrated import calibrate, with_camera
from sheetoflight.workflow.rig_folder import load_rig

REAL = Path(__file__).parents[3] / "shared" / "real"

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the real photographs are not here")

PUBLISHED_CAMERA = """
image_width: 640
image_height: 480
camera_matrix: [[514.41205, 0, 329.83671], [0, 685.92876, 237.71471], [0, 0, 1]]
distortion_coefficients: [-0.350373, 0.158447, 0.000735, -0.000231, 0]
"""


def board(columns: int, rows: int, pitch_mm: float) -> str:
    size = f"columns = {columns}\nrows = {rows}\npitch_mm = [{pitch_mm}, {pitch_mm}]\n"
    return f'[board]\nkind = "chessboard"\n{size}'


@pytest.fixture(scope="module")
def photographed(tmp_path_factory: pytest.TempPathFactory):
    """Read a folder of photographs as a rig's stage board, once."""

    @cache
    def run(photographs: str, description: str, turned: bool = False, camera: str = ""):
        folder = tmp_path_factory.mktemp("rig")
        (folder / "board").mkdir()
        (folder / "rig.toml").write_text(description)
        for path in sorted((REAL / photographs).iterdir()):
            if path.suffix not in (".jpg", ".png"):
                continue
            if turned:  # as the authors held the camera
                stored = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
                assert stored is not None
                upright = cv2.flip(cv2.transpose(stored), 1)
                cv2.imwrite(str(folder / "board" / f"{path.stem}.png"), upright)
            else:
                (folder / "board" / path.name).write_bytes(path.read_bytes())
        rig = load_rig(folder)
        if camera:
            (folder / "camera.yaml").write_text(camera)
            rig = with_camera(rig, folder / "camera.yaml")
        return rig

    return run


@pytest.fixture(scope="module")
def calibrated(photographed):
    """Calibrate such a rig, once."""

    @cache
    def run(*described, **more):
        return calibrate(photographed(*described, **more))

    return run


def off(found: Calibration, normal: tuple[float, float, float], distance: float) -> tuple:
    """Angle to a reference sheet in degrees, difference of the distances in mm, and both over
    what the calibration says of its own error."""
    plane = found.light_plane
    reference = np.array(normal) / np.linalg.norm(normal)
    angle = np.degrees(np.arccos(min(1.0, float(plane.normal @ reference))))
    names = tuple(f"laser.{part}" for part in ("nx", "ny", "nz"))
    spread = np.degrees(np.sqrt(np.trace(found.covariance.block(names))))
    shift = plane.distance_mm - distance
    return angle, shift, angle / spread, shift / found.covariance.std("laser.d")


def test_a_published_camera_comes_back(calibrated) -> None:
    found = calibrated("ciclop_3dscanscience/camera", board(11, 6, 13.0), True)
    published = [1430.39147, 1429.66307, 636.40393, 478.03271]
    assert np.abs(found.camera.parameters[[0, 1, 3, 4]] - published).max() < 0.05
    assert found.light_planes == ()
    assert any("laser was off" in warning for warning in found.warnings)


def test_hand_held_boards_give_their_published_camera(calibrated) -> None:
    found = calibrated("srv_desktop/camera", board(8, 6, 40.0))
    assert (
        np.abs(found.camera.parameters[[0, 1, 3, 4]] - [620.27, 618.61, 322.95, 239.42]).max() < 2.5
    )
    assert found.light_planes == ()


def test_a_sheet_close_to_its_camera(calibrated) -> None:
    found = calibrated("hjamal_green", board(6, 8, 40.0), camera=PUBLISHED_CAMERA)
    angle, shift, _, _ = off(found, (-0.99988, -0.01436, -0.00528), 39.376)
    assert angle < 1.0
    assert abs(shift) < 1.5


def test_each_line_of_it_lies_in_the_sheet_of_the_others(photographed) -> None:
    """Published is a median of 1.6 mm; the camera is but 39 mm from the sheet."""
    rig = photographed("hjamal_green", board(6, 8, 40.0), camera=PUBLISHED_CAMERA)
    rig = screened_boards(rig).rig
    heights = list(left_out_heights(rig))
    assert len(heights) == 6
    assert np.median(np.abs(heights)) <= 1.6


def test_lines_that_go_on_beside_the_plate_give_its_sheet(calibrated) -> None:
    found = calibrated("etna_robot/set0", board(7, 6, 10.0))
    angle, shift, _, _ = off(found, (0.7897, 0.0588, 0.6107), 179.90)
    assert angle < 0.2
    assert abs(shift) < 0.5


@pytest.mark.parametrize(
    ("photographs", "normal", "distance"),
    [
        ("etna_robot/calib2", (-0.8370, -0.1204, 0.5339), 98.92),
        ("etna_robot/set0", (0.7897, 0.0588, 0.6107), 179.90),
    ],
)
def test_references_lie_within_what_is_said_of_the_error(
    calibrated, photographs: str, normal: tuple[float, float, float], distance: float
) -> None:
    """The references are single runs on the same pictures, with errors of their own."""
    found = calibrated(photographs, board(7, 6, 10.0))
    _, _, angle, shift = off(found, normal, distance)
    assert angle < 3.0
    assert abs(shift) < 3.0


def test_uncertainties_cover_what_two_sets_of_one_camera_disagree_on(calibrated) -> None:
    found = [calibrated(f"etna_robot/{s}", board(7, 6, 10.0)) for s in ("calib2", "set0")]
    for part in ("alpha", "beta"):
        values = [c.camera.parameters[c.camera.PARAMETERS.index(part)] for c in found]
        spread = np.hypot(*(c.covariance.std(f"camera.{part}") for c in found))
        assert abs(values[0] - values[1]) < 2.0 * spread
