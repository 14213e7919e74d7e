"""``sol detect``: what it says of what it did not search for."""

from __future__ import annotations

from pathlib import Path

import pytest

from sheetoflight.cli.main import main
from tests.rendered import rendered, rig_folder

__all__ = ["rendered", "rig_folder"]

CROSSING = "c0,crossing,0,100,200,\nc0,crossing,1,300,200,\nc0,crossing,laser,250.5,200,0.2\n"


def test_views_that_were_kept_are_not_told_as_found(
    rig_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = rig_folder / "points.csv"
    points.write_text(points.read_text() + CROSSING)
    assert main(["detect", str(rig_folder)]) == 0
    out = capsys.readouterr().out
    assert "camera: target found in 7 of 7 pictures" in out
    assert "crossing: 1 view kept from points.csv" in out
