"""One of other people's photographs handed in mirrored: it is named, and no other."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.model.rig import Rig
from sheetoflight.workflow.rig_folder import load_rig

REAL = Path(__file__).parents[3] / "shared" / "real"
BOARD = '[board]\nkind = "chessboard"\ncolumns = 6\nrows = 8\npitch_mm = [40.0, 40.0]\n'

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the real photographs are not here")


def loaded(folder: Path, mirrored: str) -> Rig:
    (folder / "board").mkdir(parents=True)
    (folder / "rig.toml").write_text(BOARD)
    for path in sorted((REAL / "hjamal_green").glob("*.jpg")):
        content = path.read_bytes()
        if path.stem != mirrored:
            (folder / "board" / path.name).write_bytes(content)
            continue
        picture = cv2.imread(str(path))
        assert picture is not None
        cv2.imwrite(str(folder / "board" / f"{path.stem}.png"), cv2.flip(picture, 1))
    return load_rig(folder)


def told(rig: Rig) -> list[str]:
    return [words for words in screened_boards(rig).wrong if "the picture is" in words]


@pytest.mark.parametrize("mirrored", ["", "5_right"])
def test_only_the_mirrored_photograph_is_named(tmp_path: Path, mirrored: str) -> None:
    found = told(loaded(tmp_path / "rig", mirrored))
    named = f"view {mirrored} of stage board (the picture is mirrored)"
    assert found == ([named] if mirrored else [])
