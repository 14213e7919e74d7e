"""Rig folders with boards, and with targets that cross the sheet."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sheetoflight.imaging.boards import find_board
from sheetoflight.io.pictures import read_picture
from sheetoflight.model.board import PlanarBoard
from sheetoflight.workflow.simulated import SimulationOptions, simulate

CHARUCO = PlanarBoard("charuco", 10, 7, (20.0, 20.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A pair of one view of each stage."""
    folder = tmp_path_factory.mktemp("boards") / "rig"
    simulate(folder, SimulationOptions(0, 0, (), clutter=0, board_views=1, crossing_views=1,
                                       board=CHARUCO))  # fmt: skip
    return folder


def test_files_of_pairs(folder):
    files = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
    pictures = {f"{s}/{s}00_{on}.png" for s in ("board", "crossing") for on in ("off", "on")}
    assert files == pictures | {"rig.toml", "truth.json"}


def test_a_simulated_charuco_board_is_found_where_it_is(folder):
    """All 70 corners, in their own order; the noise of 20 000 electrons moves none by 0.5 px."""
    truth = json.loads((folder / "truth.json").read_text())
    off, on = (read_picture(folder / "board" / f"board00_{x}.png") for x in ("off", "on"))
    sighting = find_board(off, CHARUCO, on).sighting
    assert sighting is not None
    expected = truth["views"]["board"]["board00"]["points_uv"]
    np.testing.assert_allclose(sighting.uv, expected, atol=0.5)


def test_single_pictures(tmp_path):
    options = SimulationOptions(0, 0, (), clutter=0, crossing_views=1, pairs=False)
    truth = simulate(tmp_path / "rig", options)
    assert [p.name for p in (tmp_path / "rig" / "crossing").iterdir()] == ["crossing00.png"]
    assert not (tmp_path / "rig" / "board").exists()
    assert "board" not in truth
    assert len(truth["views"]["crossing"]["crossing00"]["spots_uv"]) == 1
