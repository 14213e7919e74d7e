"""The older methods for boards on other people's photographs."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.model.calibration import Calibration
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.calibrated import calibrate
from sheetoflight.workflow.rig_folder import load_rig

REAL = Path(__file__).parents[3] / "shared" / "real"

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the real photographs are not here")

PLATE = '[board]\nkind = "chessboard"\ncolumns = 7\nrows = 6\npitch_mm = [10.0, 10.0]\n'

REFERENCES = {
    "calib2": ((-0.8370, -0.1204, 0.5339), 98.92),
    "set0": ((0.7897, 0.0588, 0.6107), 179.90),
}


@pytest.fixture(scope="module")
def plates(tmp_path_factory: pytest.TempPathFactory):
    """The rig of a set of photographs of the robot's plate, read once."""

    @cache
    def read(name: str) -> Rig:
        folder = tmp_path_factory.mktemp("rig")
        (folder / "board").mkdir()
        (folder / "rig.toml").write_text(PLATE)
        for path in sorted((REAL / "etna_robot" / name).iterdir()):
            if path.suffix in (".jpg", ".png"):
                (folder / "board" / path.name).write_bytes(path.read_bytes())
        return load_rig(folder)

    return read


@pytest.mark.parametrize("method", ["planar-lines", "cross-ratio"])
@pytest.mark.parametrize("name", REFERENCES)
def test_references_lie_within_what_is_said_of_the_error(plates, name: str, method: str) -> None:
    """The references are single runs on the same pictures, with errors of their own."""
    found: Calibration = calibrate(plates(name), method)
    normal, distance = REFERENCES[name]
    plane, covariance = found.light_plane, found.covariance
    reference = np.array(normal) / np.linalg.norm(normal)
    angle = np.arccos(min(1.0, float(plane.normal @ reference)))
    spread = np.sqrt(np.trace(covariance.block(("laser.nx", "laser.ny", "laser.nz"))))
    assert angle < 3.0 * spread
    assert abs(plane.distance_mm - distance) < 3.0 * covariance.std("laser.d")
