"""What is loaded before it is needed: nothing heavy on import, no NumPy for ``sol --help``."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = frozenset(
    {
        *("cv2", "h5py", "laspy", "matplotlib", "meshio", "numba"),
        *("pandas", "plotly", "pye57", "pymoo", "scipy"),
    }
)

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


def test_a_line_in_one_picture_waits_for_no_compiler():
    """Numba takes seconds to compile; only streams and clouds of many points are worth that."""
    result = run(
        "import sys, numpy as np, sheetoflight as sol\n"
        "v, u = np.indices((60, 80))\n"
        "line = 200 * np.exp(-0.5 * ((v - 31.3 - 0.1 * u) / 1.5) ** 2)\n"
        "assert len(sol.extract_stripe(np.rint(20 + line).astype(np.uint8))) > 70\n"
        "print(*sys.modules)"
    )
    assert result.returncode == 0, result.stderr
    assert "numba" not in loaded(result.stdout)
