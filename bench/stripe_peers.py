"""The laser line's centres by this package and by what people use instead: errors and speed.

Every method sees the same drawn frames in the same run, in turn, with OpenCV on one thread. The
line, its pixels integrated exactly, crosses every column; the error is the signed distance from it.
The peers (`bench._stripe_peers`) are told its width, height and dark level; ours nothing. Run with
``python -m bench.stripe_peers [--quick] [--full]``; ``--full`` prints bias and speed of each kind.

Filters that smooth along the line share noise among neighbours, which makes single centres of a
straight line look better than their own pixels allow; the mean over 64 columns is judged too. At
the picture's border most filters bend the line: errors count from 32 px inside it on, for all.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from bench._drawn_stripes import DARK_LEVEL
from bench._stripe_frames import KINDS, Frame, drawn_frames
from bench._stripe_methods import METHODS, installed
from bench._stripe_peers import Told
from sheetoflight.geometry.directions import Array

NEAR_PX = 3.0
MARGIN_PX = 32
MEAN_COLUMNS = 64
_OVER_ALL = ("worst bias", "least found %", "most false / frame", "ms / frame", "Mpx/s")


@dataclass(frozen=True)
class Row:
    """What one method did on the frames of one kind.

    Parameters
    ----------
    kind, name : str
    rms, bias : float
        Root mean square and mean of the signed distance of centres within 3 px of the line, px,
        of those not within 32 px of the picture's left and right border.
    mean_rms : float
        Root mean square of their means over 64 columns each, px.
    found : float
        Part of these columns with such a centre.
    false : float
        Centres further off, a frame, anywhere in it.
    frames : int
        How many frames it was given: fewer to slow ones.
    ms, megapixels : float
        Median milliseconds a frame; million pixels a second.
    """

    kind: str
    name: str
    rms: float
    bias: float
    mean_rms: float
    found: float
    false: float
    frames: int
    ms: float
    megapixels: float


def compared(
    frames: Sequence[Frame], names: Sequence[str], seconds_each: float = np.inf
) -> list[Row]:
    """Errors and speed of some of `METHODS` on the same frames, in turn.

    Parameters
    ----------
    frames : sequence of Frame
        Those of a kind follow one another.
    names : sequence of str
    seconds_each : float
        A method slower than this on a kind's frames leaves the rest of them out.

    Returns
    -------
    list of Row
        One for each kind and method.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for name in names:
            _found(name, frames[0])  # loads and compiles
        return [
            row
            for _, kind in groupby(frames, key=lambda frame: frame.kind)
            for row in _of_one_kind(list(kind), names, seconds_each)
        ]
    finally:
        cv2.setNumThreads(threads)


def _of_one_kind(frames: list[Frame], names: Sequence[str], seconds_each: float) -> list[Row]:
    spent: dict[str, list[float]] = {name: [] for name in names}
    centres: dict[str, list[Array]] = {name: [] for name in names}
    for frame in frames:
        for name in names:
            most = METHODS[name].most_frames or len(frames)
            if len(spent[name]) < most and sum(spent[name]) < seconds_each:
                uv, seconds = _found(name, frame)
                spent[name].append(seconds)
                centres[name].append(uv)
    return [_row(name, frames, centres[name], spent[name]) for name in names]


def _found(name: str, frame: Frame) -> tuple[Array, float]:
    """Centres and seconds."""
    height = min(frame.line.amplitude, frame.line.full - DARK_LEVEL)
    told = Told(frame.line.width, height, DARK_LEVEL)
    begin = time.perf_counter()
    uv = METHODS[name].find(frame.picture, told)
    return uv, time.perf_counter() - begin


def _row(name: str, frames: list[Frame], centres: list[Array], spent: list[float]) -> Row:
    errors, means, found, false = [], [], [], []
    for frame, uv in zip(frames, centres, strict=False):
        off = frame.line.distances(uv)
        near = np.abs(off) <= NEAR_PX
        false.append(int((~near).sum()))
        judged = near & _inside(uv[:, 0], frame)
        column = np.rint(uv[judged, 0]).astype(np.int64)
        errors.append(off[judged])
        means.append(_means(off[judged], (column - MARGIN_PX) // MEAN_COLUMNS))
        inside = int(_inside(np.arange(frame.line.shape[1]), frame).sum())
        found.append(len(np.unique(column)) / inside)
    error, mean, median = np.concatenate(errors), np.concatenate(means), float(np.median(spent))
    return Row(
        kind=frames[0].kind,
        name=name,
        rms=_rms(error),
        bias=float(error.mean()) if len(error) else np.nan,
        mean_rms=_rms(mean),
        found=float(np.mean(found)),
        false=float(np.mean(false)),
        frames=len(centres),
        ms=1e3 * median,
        megapixels=frames[0].picture.size / 1e6 / median,
    )


def _inside(u: NDArray[Any], frame: Frame) -> NDArray[np.bool_]:
    """Whether columns lie well inside the picture."""
    column = np.rint(u)
    return (column >= MARGIN_PX) & (column < frame.line.shape[1] - MARGIN_PX)


def _means(values: Array, group: NDArray[np.int64]) -> Array:
    groups, index = np.unique(group, return_inverse=True)
    return np.bincount(index, values, len(groups)) / np.bincount(index, minlength=len(groups))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else np.nan


def centres_table(rows: Sequence[Row], title: str) -> Table:
    """Errors of the centres in each kind, and over all kinds what else there is to know.

    In brackets where fewer than 90 % of the columns are found, or where there is a false centre a
    frame or more.
    """
    table = _of_kinds(rows, title, _OVER_ALL)
    bounds = (f"{KINDS[kind].pixel_bound:.4f}" for kind in _kinds(rows))
    table.add_row("bound of one column's pixels", *bounds, *"–" * len(_OVER_ALL))
    for name, of_it in _by_name(rows):
        table.add_row(name, *(_cell(row, row.rms) for row in of_it), *_over_all(of_it))
    return table


def means_table(rows: Sequence[Row], title: str) -> Table:
    """Errors of means over neighbouring columns in each kind; brackets as in `centres_table`."""
    table = _of_kinds(rows, title)
    root = np.sqrt(MEAN_COLUMNS)
    bounds = (f"{KINDS[kind].pixel_bound / root:.4f}" for kind in _kinds(rows))
    table.add_row("bound of their pixels", *bounds)
    for name, of_it in _by_name(rows):
        table.add_row(name, *(_cell(row, row.mean_rms) for row in of_it))
    return table


def _of_kinds(rows: Sequence[Row], title: str, more: Sequence[str] = ()) -> Table:
    table = Table(title=title, box=box.MARKDOWN, title_justify="left")
    for heading in ("method", *_kinds(rows), *more):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    return table


def _kinds(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.kind for row in rows))


def _by_name(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    for name in dict.fromkeys(row.name for row in rows):
        yield name, [row for row in rows if row.name == name]


def _cell(row: Row, value: float) -> str:
    if np.isnan(value):
        return "–"
    trusted = row.found > 0.9 and row.false < 1.0
    return f"{value:.4f}" if trusted else f"({value:.4f})"


def _over_all(rows: list[Row]) -> list[str]:
    ms = float(np.median([row.ms for row in rows]))
    return [
        f"{max((row.bias for row in rows), key=np.abs):+.4f}",
        f"{100.0 * min(row.found for row in rows):.1f}",
        f"{max(row.false for row in rows):.1f}",
        f"{ms:.2f}" if ms < 10.0 else f"{ms:.0f}",
        f"{np.median([row.megapixels for row in rows]):.3g}",
    ]


def every_row(rows: Sequence[Row]) -> Table:
    """All that was found out."""
    table = Table(title="Every kind and method", box=box.MARKDOWN, title_justify="left")
    headings = ("kind", "method", "rms px", "bias px", "mean of 64, rms px", "found %",
                "false / frame", "frames", "ms / frame", "Mpx/s")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="left" if heading in headings[:2] else "right")
    for row in rows:
        table.add_row(
            row.kind, row.name, f"{row.rms:.4f}", f"{row.bias:+.4f}", f"{row.mean_rms:.4f}",
            f"{100.0 * row.found:.1f}", f"{row.false:.1f}", str(row.frames), f"{row.ms:.3g}",
            f"{row.megapixels:.3g}",
        )  # fmt: skip
    return table


def main() -> None:
    """Print the tables."""
    quick = "--quick" in sys.argv
    shape, count, seconds = ((384, 512), 2, 2.0) if quick else ((768, 1024), 5, 20.0)
    console = Console(width=250)
    names, missing = installed(METHODS)
    for line in missing:
        console.print(line)
    rows = compared(drawn_frames(shape, count), names, seconds)
    size = f"{shape[1]} x {shape[0]} px, {count} frames a kind"
    console.print(centres_table(rows, f"Centres, {size}: rms distance from the line, px"))
    means = f"Means over {MEAN_COLUMNS} columns: rms distance from the line, px"
    console.print(means_table(rows, means))
    if "--full" in sys.argv:
        console.print(every_row(rows))


if __name__ == "__main__":
    main()
