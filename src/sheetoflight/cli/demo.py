"""``sol demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from sheetoflight.cli.telling import on_all_cores, plain_table, tell, tell_table, warn
from sheetoflight.report.contents import Table
from sheetoflight.workflow.demonstration import (
    PAPER_TABLES,
    ROD_METHODS,
    comparison_tables,
    demonstrate,
)


def demo(
    folder: Path = Path("demo"),
    /,
    *,
    seed: int = 0,
    method: Annotated[
        tuple[Literal["joint", "two-step", "paper"], ...], Parameter(consume_multiple=True)
    ] = ROD_METHODS,
) -> None:
    """The main job on the paper's rig, rendered: pictures to lengths, and a report.

    Parameters
    ----------
    folder
        Where everything is written; new, empty, or of an earlier demonstration.
    seed
        The same seed gives the same bytes.
    method
        The methods to compare; the report is on the first.
    """
    with on_all_cores() as run:
        found = demonstrate(folder, method, seed, run)
    error = found.detection_error_px
    tell(
        f"markers: {found.pictures - found.missed} of {found.pictures} targets found, error "
        f"{np.median(error):.3f} px median, {error.max():.3f} px at most"
    )
    for name, lengths, _ in PAPER_TABLES:
        measured = sum(c.table == name for c in found.comparisons)
        if measured < len(lengths):
            warn(f"{name}: {len(lengths) - measured} of {len(lengths)} bars were not measured")
    for compared in comparison_tables(found):
        _tell(compared)
    tell("rendered targets are flat and truly in the sheet: a real rig is limited by its target")
    tell(f"written to {folder}: open {folder / 'report.html'}")


def _tell(compared: Table) -> None:
    table = plain_table(compared.title, (compared.columns[0],), compared.columns[1:])
    for index, row in enumerate(compared.rows):
        table.add_row(*map(str, row), style="bold" if index in compared.highlight else None)
    tell_table(table)
