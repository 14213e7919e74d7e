"""``stripe.csv``: the laser line's centres, picture by picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from sheetoflight.io.atomic import written_whole
from sheetoflight.io.csv_table import table_text
from sheetoflight.model.stripe import Stripe

STRIPE_COLUMNS = ("image", "u", "v", "std_px", "width_px", "peak")
FURTHER_COLUMNS = ("line", "across_u", "across_v")

NamedStripe = tuple[str, Stripe]
"""A picture's name and the line in it."""


def stripe_csv(stripes: Iterable[NamedStripe], further: bool = False) -> Iterator[str]:
    """The text of ``stripe.csv``, one part for the header and one for each picture.

    Parameters
    ----------
    stripes : iterable of (str, Stripe)
        Only good centres are written.
    further : bool
        Add which line of the picture a centre belongs to, and the unit direction across it.
    """
    columns = (*STRIPE_COLUMNS, *(FURTHER_COLUMNS if further else ()))
    yield table_text(columns, ())
    for name, stripe in stripes:
        yield _rows(name, stripe.taken(stripe.good), further)


def write_stripes(path: str | Path, stripes: Iterable[NamedStripe], further: bool = False) -> None:
    """Write ``stripe.csv`` as the pictures come, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with written_whole(path) as beside, beside.open("w", encoding="utf-8") as file:
        file.writelines(stripe_csv(stripes, further))


def _rows(name: str, stripe: Stripe, further: bool) -> str:
    columns = [stripe.uv[:, 0], stripe.uv[:, 1], stripe.std, stripe.width, stripe.peak]
    if further:
        columns += [stripe.line, stripe.across[:, 0], stripe.across[:, 1]]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return table_text(None, ((name, *row) for row in rows))
