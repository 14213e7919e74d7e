"""A small rendered rig folder that tests of the upper floors share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from sheetoflight.workflow.rig_folder import detect
from sheetoflight.workflow.simulated import SimulationOptions, simulate
from sheetoflight.workflow.spread import Execution

SMALL = SimulationOptions(camera_views=7, plane_views=4, bars_mm=(300.0, 150.0), clutter=4, seed=3)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated rig folder with its points.csv; not to be changed."""
    folder = tmp_path_factory.mktemp("rendered") / "rig"
    simulate(folder, SMALL)
    detect(folder, Execution())
    return folder


@pytest.fixture
def rig_folder(rendered: Path, tmp_path: Path) -> Path:
    """A copy of it, to be damaged."""
    return Path(shutil.copytree(rendered, tmp_path / "rig"))
