"""What is loaded before it is needed: nothing heavy on import, no NumPy for ``sol --help``."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = frozenset({"cv2", "matplotlib", "numba", "pandas", "plotly", "pymoo", "scipy"})

# As the console script does it; modules are listed on standard error when all is said.
HELP = """
import atexit, sys
atexit.register(lambda: print(*sys.modules, file=sys.stderr))
sys.argv = ["sol", "--help"]
from sheetoflight.cli.main import main
sys.exit(main())
"""


def loaded(modules: str) -> set[str]:
    """Top-level names of the modules listed."""
    return {name.partition(".")[0] for name in modules.split()}


def run(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )


def test_importing_the_package_loads_nothing_heavy():
    result = run("import sys, sheetoflight; print(*sys.modules)")
    assert result.returncode == 0, result.stderr
    assert "sheetoflight" in loaded(result.stdout)
    assert not loaded(result.stdout) & HEAVY


def test_help_loads_no_numpy():
    result = run(HELP)
    assert result.returncode == 0, result.stderr
    assert "calibrate" in result.stdout
    assert "sheetoflight" in loaded(result.stderr)
    assert not loaded(result.stderr) & (HEAVY | {"numpy"})


@pytest.mark.parametrize(
    "floor", ["errors", "geometry.planes", "model.camera", "model.calibration"]
)
def test_the_lower_floors_need_numpy_alone(floor: str):
    result = run(f"import sys, sheetoflight.{floor}; print(*sys.modules)")
    assert result.returncode == 0, result.stderr
    assert not loaded(result.stdout) & HEAVY
