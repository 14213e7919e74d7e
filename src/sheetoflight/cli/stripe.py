"""``sol stripe``."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Iterator
from tempfile import SpooledTemporaryFile
from typing import IO, Annotated

import numpy as np
from cyclopts import Parameter
from rich.markup import escape

from sheetoflight.cli.looking import (
    BY_DEFAULT,
    Damage,
    LookFor,
    Strict,
    check_output,
    counted,
)
from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    Output,
    on_all_cores,
    plain_table,
    tell,
    tell_json,
    tell_table,
)
from sheetoflight.errors import InputError
from sheetoflight.io.frames import Frame, list_frames
from sheetoflight.io.quoting import file_name
from sheetoflight.io.stripe_csv import NamedStripe, stripe_csv, write_stripes
from sheetoflight.model.stripe import Stripe
from sheetoflight.workflow.stripes import find_stripes

_MOST_ROWS = 20
_MOST_IN_MEMORY = 16 * 1024 * 1024


class Summaries:
    """What was found, picture by picture.

    Parameters
    ----------
    keep : bool
        Remember every picture, else as many as a table shows.
    """

    def __init__(self, keep: bool = False) -> None:
        self.rows: list[dict[str, object]] = []
        self.pictures = 0
        self.centres = 0
        self._reasons: dict[str, str] = {}
        self._keep = keep

    def noted(self, found: Iterator[tuple[Frame, Stripe]]) -> Iterator[NamedStripe]:
        """The same by the frames' names, each summed up as it passes."""
        for frame, seen in found:
            good = seen.taken(seen.good)
            self.pictures += 1
            self.centres += len(good)
            self._reasons.setdefault(seen.detector, seen.reason)
            if self._keep or self.pictures <= _MOST_ROWS:
                self.rows.append(_summary(file_name(frame.name), seen, good))
            yield frame.name, seen

    def tell(self) -> None:
        """Print a table, of the first pictures if they are many."""
        table = plain_table(
            "The line, medians", ("image",), ("lines", "centres", "std px", "width px", "peak")
        )
        table.add_column("detector")
        for row in self.rows:
            numbers = (_shown(row[key]) for key in ("std_px", "width_px", "peak"))
            table.add_row(
                escape(str(row["image"])),
                str(row["lines"]),
                str(row["centres"]),
                *numbers,
                str(row["detector"]),
            )
        tell_table(table)
        if self.pictures > len(self.rows):
            tell(f"and {counted(self.pictures - len(self.rows), 'picture')} more")
        for detector, reason in self._reasons.items():
            tell(f"{detector}: {reason}")


def _summary(name: str, seen: Stripe, good: Stripe) -> dict[str, object]:
    return {
        "image": name,
        "lines": seen.lines,
        "centres": len(good),
        "left_out": len(seen) - len(good),
        "std_px": _median(good.std),
        "width_px": _median(good.width),
        "peak": _median(good.peak),
        "noise_std": seen.noise_std,
        "detector": seen.detector,
        "reason": seen.reason,
    }


def stripe(
    inputs: Inputs,
    /,
    *,
    output: Output = None,
    look: LookFor = BY_DEFAULT,
    all_columns: Annotated[bool, Parameter(name="--all-columns", negative=())] = False,
    strict: Strict = False,
    json: AsJson = False,
) -> None:
    """The laser line's centres in pictures.

    Parameters
    ----------
    inputs
        Pictures, pairs NAME_off.* and NAME_on.*, folders, multi-page TIFF files, .npy and HDF5
        stacks, videos.
    output
        Where to write stripe.csv; its rows are printed where absent.
    look
        How the line is looked for.
    all_columns
        Write also which line of its picture a centre belongs to, and the direction across it.
    strict
        End with status 2 if a picture could not be used, after the others are finished.
    json
        Print what was found in each picture as JSON, in place of the rows.
    """
    frames = list_frames(inputs)
    if output:
        check_output(output, [*frames.files, *look.files])
    damage, summaries = Damage(json), Summaries(json)
    with SpooledTemporaryFile(_MOST_IN_MEMORY, "w+", encoding="utf-8", newline="") as rows:
        with on_all_cores() as run:
            sound = damage.sound(find_stripes(frames, look.options, look.background, run))
            found = _judged(summaries.noted(sound), damage, summaries)
            if output:
                write_stripes(output, found, all_columns)
            elif json:
                for _ in found:
                    pass
            else:
                _hold(rows, stripe_csv(found, all_columns))
        # not while the progress bar is shown, which draws standard output to itself
        rows.seek(0)
        shutil.copyfileobj(rows, sys.stdout)
    if json:
        tell_json({"pictures": summaries.rows, "skipped": damage.skipped()})
    elif output:
        summaries.tell()
        pictures = f"{counted(damage.used, 'picture')}{damage.ending}"
        tell(f"{counted(summaries.centres, 'centre')} of {pictures} written to {output}")
    if strict:
        damage.refuse_any()


def _judged(
    found: Iterator[NamedStripe], damage: Damage, summaries: Summaries
) -> Iterator[NamedStripe]:
    """Everything found; if that is nothing, refused before anything is written."""
    yield from found
    damage.judge(summaries.centres)


def _hold(file: IO[str], parts: Iterable[str]) -> None:
    """Write text to where it waits until all of it is there.

    Raises
    ------
    InputError
        If a name in it is no text.
    """
    try:
        file.writelines(parts)
    except UnicodeEncodeError as error:
        raise InputError(
            "the name of a picture holds characters that are no text", "rename it"
        ) from error


def _median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if len(values) else None


def _shown(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else "–"
