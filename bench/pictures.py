"""End to end from rendered pictures: the paper's Tables 2 and 4 by every method, several seeds.

Each seed renders the paper's rig anew – 30 camera views, 10 positions in the sheet, a bar for each
length – detects, calibrates and measures. Run with ``python -m bench.pictures [SEEDS]``; a seed
takes about a minute.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.workflow.demonstration import PAPER_TABLES, Demonstration, demonstrate
from sheetoflight.workflow.spread import Execution, cores, tell_nobody


def demonstrations(seeds: int) -> list[Demonstration]:
    """One demonstration a seed."""
    found = []
    for seed in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            run = Execution(tell_nobody, cores())
            found.append(demonstrate(Path(folder) / "demo", seed=seed, run=run))
    return found


def main(seeds: int = 3) -> None:
    """Print the tables."""
    found = demonstrations(seeds)
    errors = np.concatenate([demonstration.detection_error_px for demonstration in found])
    console = Console(width=100)
    console.print(
        f"{seeds} rigs: {sum(d.missed for d in found)} of {sum(d.pictures for d in found)} "
        f"targets missed; marker error {np.median(errors):.4f} px median, "
        f"{np.quantile(errors, 0.95):.4f} px at 95 %"
    )
    table = Table(title="Mean |error| of lengths in mm")
    for heading in ("table", "printed in the paper", *found[0].methods, "bars measured"):
        table.add_column(heading, justify="left" if heading == "table" else "right")
    for name, lengths, printed in PAPER_TABLES:
        figures = (
            f"{np.mean([d.mean_error_mm(name, method) for d in found]):.4f}"
            for method in found[0].methods
        )
        measured = sum(c.table == name for d in found for c in d.comparisons)
        total = seeds * len(lengths)
        table.add_row(name, f"{np.mean(printed):.3f}", *figures, f"{measured} of {total}")
    console.print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
