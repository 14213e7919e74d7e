"""``sol stripe``."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from sheetoflight.cli.looking import BY_DEFAULT, Damage, LookFor
from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    Output,
    on_all_cores,
    plain_table,
    refuse_to_overwrite,
    tell,
    tell_json,
    tell_table,
)
from sheetoflight.io.frames import list_frames
from sheetoflight.io.stripe_csv import stripe_csv, write_stripes
from sheetoflight.model.stripe import Stripe
from sheetoflight.workflow.stripes import find_stripes

_MOST_ROWS = 20


class Summaries:
    """What was found, picture by picture."""

    def __init__(self) -> None:
        self.rows: list[dict[str, object]] = []
        self.centres = 0

    def noted(self, found: Iterator[tuple[str, Stripe]]) -> Iterator[tuple[str, Stripe]]:
        """The same, each picture summed up as it passes."""
        for name, seen in found:
            good = seen.taken(seen.good)
            self.centres += len(good)
            self.rows.append(
                {
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
            )
            yield name, seen

    def tell(self) -> None:
        """Print a table, of the first pictures if they are many."""
        table = plain_table(
            "The line, medians", ("image",), ("lines", "centres", "std px", "width px", "peak")
        )
        table.add_column("detector")
        for row in self.rows[:_MOST_ROWS]:
            numbers = (_shown(row[key]) for key in ("std_px", "width_px", "peak"))
            table.add_row(
                str(row["image"]),
                str(row["lines"]),
                str(row["centres"]),
                *numbers,
                f"{row['detector']}: {row['reason']}",
            )
        tell_table(table)
        if len(self.rows) > _MOST_ROWS:
            tell(f"and {len(self.rows) - _MOST_ROWS} pictures more")


def stripe(
    inputs: Inputs,
    /,
    *,
    output: Output = None,
    look: LookFor = BY_DEFAULT,
    all_columns: bool = False,
    strict: bool = False,
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
    if output:
        refuse_to_overwrite(output, inputs)
    frames = list_frames(inputs)
    damage, summaries = Damage(), Summaries()
    with on_all_cores() as run:
        found = summaries.noted(
            (frame.name, seen)
            for frame, seen in damage.sound(
                find_stripes(frames, look.options, look.background, run)
            )
        )
        if output:
            write_stripes(output, _judged(found, damage, summaries), all_columns)
        elif json:
            for _ in _judged(found, damage, summaries):
                pass
        else:
            sys.stdout.writelines(stripe_csv(_judged(found, damage, summaries), all_columns))
    if json:
        tell_json({"pictures": summaries.rows, "skipped": _skipped(damage)})
    elif output:
        summaries.tell()
        skipped = f", {len(damage.frames)} skipped" if damage.frames else ""
        tell(f"{summaries.centres} centres of {damage.used} pictures{skipped} written to {output}")
    if strict:
        damage.refuse_any()


def _judged(
    found: Iterator[tuple[str, Stripe]], damage: Damage, summaries: Summaries
) -> Iterator[tuple[str, Stripe]]:
    """Everything found; if that is nothing, refused before the file is moved to its place."""
    yield from found
    damage.judge(summaries.centres)


def _skipped(damage: Damage) -> list[dict[str, str]]:
    return [{"image": one.frame.name, "why": one.why} for one in damage.frames]


def _median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if len(values) else None


def _shown(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else "–"
