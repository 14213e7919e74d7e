"""How commands tell their results and their progress."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from sheetoflight.errors import InputError
from sheetoflight.workflow.spread import Execution, cores

AsJson = Annotated[bool, Parameter(name="--json", negative=())]
"""The flag of commands whose result programs read."""

Output = Annotated[Path | None, Parameter(name=("--output", "-o"))]
"""The file that a command writes."""

Inputs = Annotated[list[Path], Parameter(name="INPUTS")]
"""The files that a command reads."""

_PLAIN_WIDTH = 100
_RIG_FILES = frozenset(("rig.toml", "points.csv", "truth.json"))


@contextmanager
def on_all_cores() -> Iterator[Execution]:
    """All cores, and a progress bar on standard error where that is a terminal."""
    if not sys.stderr.isatty():
        yield Execution(processes=cores())
        return
    bar = Progress(
        TextColumn("{task.description:<16}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    tasks: dict[str, Any] = {}

    def show(what: str, done: int, total: int) -> None:
        if what not in tasks:
            tasks[what] = bar.add_task(what, total=total)
        bar.update(tasks[what], completed=done)

    with bar:
        yield Execution(show, cores())


def tell_json(document: Mapping[str, Any]) -> None:
    """Print a result for programs."""
    print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


def tell_table(table: Table) -> None:
    """Print a table, as wide as the terminal, or 100 columns where there is none."""
    console = Console(width=None if sys.stdout.isatty() else _PLAIN_WIDTH, highlight=False)
    console.print(table)


def refuse_to_overwrite(output: Path, inputs: Iterable[Path]) -> None:
    """Keep a command from writing its result over what it reads.

    Raises
    ------
    InputError
        If the output is one of the inputs, or lies among the files of a rig folder.
    """
    for path in inputs:
        if output.resolve() == path.resolve():
            raise InputError(f"the output {output} is also an input", "name another file")
    if output.name in _RIG_FILES and output.exists():
        raise InputError(f"{output} belongs to a rig folder", "name another file")


def tell(text: str) -> None:
    """Print a line of the result."""
    print(text)


def warn(message: str) -> None:
    """Print a warning on standard error."""
    print(f"warning: {message}", file=sys.stderr)


def plain_table(title: str, left: tuple[str, ...], right: tuple[str, ...]) -> Table:
    """A table with left-aligned columns, then right-aligned ones."""
    table = Table(title=title, title_justify="left")
    for heading in left:
        table.add_column(heading)
    for heading in right:
        table.add_column(heading, justify="right")
    return table
