"""The import contracts of pyproject.toml hold, and each refuses the import it forbids."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINT_IMPORTS = (
    sys.executable,
    "-c",
    "from importlinter.cli import lint_imports_command as lint; lint()",
    "--no-cache",
    "--no-logo",
)

FLOORS = "Floors: a lower one never imports a higher one"
NO_CIRCLE = "Calibration and measurement do not know the simulation that tests them"
OPENCV = "OpenCV only in imaging, io and report"
PLOTS = "Matplotlib and Plotly only in report"
PEERS = "Closed forms and refinements are peers"


@dataclass(frozen=True)
class Trespass:
    """One import that must be refused, and the one contract that refuses it."""

    module: str
    statement: str
    contract: str

    @property
    def name(self) -> str:
        return f"{self.module}: {self.statement}"


TRESPASSES = (
    Trespass("errors", "import sheetoflight.geometry.planes", FLOORS),
    Trespass("geometry/planes", "import sheetoflight.model.camera", FLOORS),
    Trespass("model/camera", "import sheetoflight.estimation.ransac", FLOORS),
    # The exceptions of model.calibration are single modules, not whole floors.
    Trespass("model/calibration", "import sheetoflight.measurement", FLOORS),
    Trespass("model/camera", "import sheetoflight.measurement.length", FLOORS),
    Trespass("simulation/rig", "import sheetoflight.estimation.ransac", FLOORS),
    Trespass("estimation/ransac", "import sheetoflight.imaging", FLOORS),
    Trespass("calibration/adjustment", "import sheetoflight.measurement.length", FLOORS),
    Trespass("io/calibration_json", "import sheetoflight.report", FLOORS),
    Trespass("report", "import sheetoflight.workflow", FLOORS),
    Trespass("workflow", "import sheetoflight.cli", FLOORS),
    Trespass("calibration/adjustment", "import sheetoflight.simulation.rig", NO_CIRCLE),
    Trespass("measurement/length", "def f():\n    import sheetoflight.simulation.rig", NO_CIRCLE),
    Trespass("model/camera", "import cv2", OPENCV),
    Trespass("simulation/rig", "from cv2 import projectPoints", OPENCV),
    Trespass("workflow", "import cv2", OPENCV),
    Trespass("io", "from matplotlib import pyplot", PLOTS),
    Trespass("imaging", "import plotly.graph_objects", PLOTS),
    Trespass(
        "calibration/paper_plane", "import sheetoflight.calibration.target_triangulation", PEERS
    ),
    Trespass("calibration/adjustment", "import sheetoflight.calibration.camera_closed_form", PEERS),
)


def lint_imports(root: Path) -> subprocess.CompletedProcess[str]:
    """Check the package below `root` against the contracts of the ``pyproject.toml`` there."""
    return subprocess.run(
        LINT_IMPORTS,
        cwd=root,
        env={"PYTHONPATH": str(root / "src"), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


def broken(result: subprocess.CompletedProcess[str]) -> set[str]:
    """Names of the contracts that a check found broken."""
    return set(re.findall(r"^(.+?) BROKEN", result.stdout, flags=re.MULTILINE))


def source_file(root: Path, module: str) -> Path:
    """The file of a module, or of a package itself."""
    path = root / "src" / "sheetoflight" / module
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project that may be spoiled."""
    root = tmp_path_factory.mktemp("copy")
    shutil.copy(ROOT / "pyproject.toml", root)
    shutil.copytree(
        ROOT / "src", root / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
    )
    return root


@pytest.fixture(scope="module")
def untouched() -> subprocess.CompletedProcess[str]:
    """The check of the package as it is."""
    return lint_imports(ROOT)


def test_the_package_keeps_its_contracts(untouched: subprocess.CompletedProcess[str]):
    assert untouched.returncode == 0, untouched.stdout + untouched.stderr


@pytest.mark.parametrize("trespass", TRESPASSES, ids=lambda trespass: trespass.name)
def test_a_forbidden_import_breaks_its_contract_and_no_other(
    copy: Path, trespass: Trespass, untouched: subprocess.CompletedProcess[str]
):
    module = source_file(copy, trespass.module)
    sound = module.read_text(encoding="utf-8")
    module.write_text(f"{sound}\n{trespass.statement}\n", encoding="utf-8")
    try:
        result = lint_imports(copy)
    finally:
        module.write_text(sound, encoding="utf-8")
    assert result.returncode == 1, result.stdout + result.stderr
    assert broken(result) - broken(untouched) == {trespass.contract}, result.stdout


def test_every_contract_is_shown_to_bite():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = {contract["name"] for contract in settings["tool"]["importlinter"]["contracts"]}
    assert contracts == {trespass.contract for trespass in TRESPASSES}


def test_a_module_without_a_floor_is_refused(copy: Path):
    stray = copy / "src" / "sheetoflight" / "attic.py"
    stray.write_text("", encoding="utf-8")
    try:
        result = lint_imports(copy)
    finally:
        stray.unlink()
    assert result.returncode == 1
    assert "sheetoflight.attic" in result.stdout
