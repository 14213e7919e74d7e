"""Camera files that other people left beside their photographs, against what they published."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.io.exchange import read_exchange

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "shared" / "real"

pytestmark = pytest.mark.skipif(
    not PHOTOGRAPHS.is_dir(),
    reason=f"the photographs are not here: no folder {Path('..') / 'shared' / 'real'}",
)

CAMERAS = {
    "srv_desktop/published/calibration4.yaml": ((640, 480), (620.27, 618.61, 322.95, 239.42)),
    "etna_robot/config/camera.yaml": ((1280, 1024), (1367.00, 1369.70, 628.44, 347.88)),
    "synthcal_generated/rig/cameras/cam00.yaml": ((1280, 960), (1800.0, 1795.0, 650.0, 470.0)),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_file_says_what_its_authors_published(name: str):
    size, published = CAMERAS[name]
    found = read_exchange(PHOTOGRAPHS / name, image_size=size)
    assert found.format == "opencv"
    camera = found.camera
    np.testing.assert_allclose(
        (camera.alpha, camera.beta, camera.u0, camera.v0), published, atol=0.005
    )
    assert any("taken in OpenCV's order" in note for note in found.notes)
