"""What finding a bar's ends costs: rendered bars of the paper's rig, true camera and sheet.

Prints, for every length, how far the found ends lie from the projected true ones and how far
the lengths triangulated with the *true* camera and light plane are off: the share of detection
alone. Run with ``python -m bench.line_ends [BARS_OF_EACH_LENGTH]``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.pieces import line_pieces
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.views import ViewOptions, picture_tasks, render_task

LENGTHS_MM = (150.0, 300.0, 450.0)
SEED = 2


@dataclass(frozen=True)
class BarErrors:
    """Errors of one bar: `along` (outwards) and `across` ``(2,)`` in px with the stated `std`,
    and of its length in mm; and how long finding it took."""

    length_mm: float
    along: Array
    across: Array
    std: Array
    length_error_mm: float
    seconds: float


def measured_bars(
    rig: SimulatedRig,
    lengths_mm: Sequence[float],
    options: ViewOptions | None = None,
    seed: int = SEED,
) -> list[BarErrors | None]:
    """Render a pair of pictures for each bar and find its ends; None where it is not found."""
    tasks = picture_tasks(rig, 0, 0, lengths_mm, options, seed)
    errors = []
    for off, on in zip(tasks[::2], tasks[1::2], strict=True):
        images = render_task(on).image, render_task(off).image
        start = time.perf_counter()
        pieces = line_pieces(*images)
        seconds = time.perf_counter() - start
        whole = [piece for piece in pieces if piece.whole]
        longest = max(whole, key=len, default=None)
        errors.append(None if longest is None else bar_errors(rig, on.truth, longest, seconds))
    return errors


def bar_errors(
    rig: SimulatedRig, truth: dict[str, Any], piece: LinePiece, seconds: float
) -> BarErrors | None:
    """Errors of a piece's ends; None where they are no ends of this bar."""
    true, ends, std = np.array(truth["ends_uv"]), piece.ends, piece.ends_std
    if np.linalg.norm(ends[0] - true[0]) > np.linalg.norm(ends[1] - true[0]):
        ends, std = ends[::-1], std[::-1]
    if np.abs(ends - true).max() > 2.0:
        return None
    along = (true[1] - true[0]) / np.linalg.norm(true[1] - true[0])
    across = np.array([-along[1], along[0]])
    xyz = rig.light_plane.intersect(rig.camera.unproject(ends))
    return BarErrors(
        length_mm=truth["length_mm"],
        along=((ends - true) @ along) * [-1.0, 1.0],
        across=(ends - true) @ across,
        std=std,
        length_error_mm=float(np.linalg.norm(xyz[1] - xyz[0])) - truth["length_mm"],
        seconds=seconds,
    )


def row(name: str, bars: list[BarErrors]) -> list[str]:
    along = np.concatenate([bar.along for bar in bars])
    across = np.concatenate([bar.across for bar in bars])
    std = np.concatenate([bar.std for bar in bars])
    lengths = np.array([bar.length_error_mm for bar in bars])
    return [
        name,
        str(len(bars)),
        f"{along.mean():+.4f} ± {along.std() / np.sqrt(along.size):.4f}",
        f"{along.std():.4f}",
        f"{np.median(np.abs(along)):.4f}",
        f"{np.sqrt(np.mean((along / std) ** 2)):.2f}",
        f"{across.mean():+.4f}",
        f"{across.std():.4f}",
        f"{lengths.mean():+.4f}",
        f"{np.mean(np.abs(lengths)):.4f}",
        f"{np.mean([bar.seconds for bar in bars]):.2f}",
    ]


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    rig = paper_rig()
    lengths = [length for length in LENGTHS_MM for _ in range(count)]
    found = [bar for bar in measured_bars(rig, lengths) if bar is not None]
    table = Table(
        "length mm", "bars", "bias px", "std px", "median px", "error / stated",
        "across: bias px", "std px", "length: mean mm", "mean absolute mm",
        "seconds a pair",
        title=f"Ends of {len(found)} of {len(lengths)} rendered bars (true camera and sheet)",
    )  # fmt: skip
    for length in LENGTHS_MM:
        bars = [bar for bar in found if abs(bar.length_mm - length) < 1e-3]
        if bars:
            table.add_row(*row(f"{length:g}", bars))
    table.add_row(*row("all", found))
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
