"""How long ``sol --help`` takes beside ``import numpy``: whole processes, in turn.

Run with ``python -m bench.startup``.
"""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np

HELP = (sys.executable, "-m", "sheetoflight.cli.main", "--help")
NUMPY = (sys.executable, "-c", "import numpy")


def seconds(command: tuple[str, ...]) -> float:
    """Wall time of one run."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def help_ratio(rounds: int = 7) -> float:
    """Median of the help's time over the import's, after one run of each to warm up."""
    for command in (HELP, NUMPY):
        seconds(command)
    return float(np.median([seconds(HELP) / seconds(NUMPY) for _ in range(rounds)]))


def main() -> None:
    """Print the ratio."""
    print(f"sol --help takes {help_ratio():.2f} times as long as import numpy (limit 3)")


if __name__ == "__main__":
    main()
