"""Rows of ``points.csv`` in stage match: points of an unknown scene, the same in several views."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.csv_table import Row
from sheetoflight.io.quoting import shown
from sheetoflight.model.matches import PointMatches

STAGE = "match"
"""What column ``stage`` says of them."""

_LARGEST = 50_000_000
"""Views times points: beyond, hardly any can be one that several views show."""


@dataclass
class MatchRows:
    """What the rows of stage match say, gathered row by row.

    Parameters
    ----------
    names : dict from view to its number
    points : dict from (view, number of the point) to u, v, std
    """

    names: dict[str, int] = field(default_factory=dict)
    points: dict[tuple[int, int], tuple[float, float, float | None]] = field(default_factory=dict)

    def add(self, row: Row) -> None:
        """Take in a row.

        Raises
        ------
        InputError
            If the point has no number, or is given twice.
        """
        number = row.whole("marker")
        if number is None:
            raise InputError(
                f"{row.place}: marker is {shown(row.cells['marker'])}, expected a whole number "
                "from 0",
                "give a point of the scene the same number in all views that show it",
            )
        view = self.names.setdefault(row.text("view"), len(self.names))
        if (view, number) in self.points:
            raise InputError(
                f"{row.place}: point {number} of view {shown(row.text('view'))} in stage {STAGE} "
                "is given twice",
                "give every point once, and every view of a stage a name of its own",
            )
        self.points[view, number] = (
            row.number("u"),
            row.number("v"),
            row.optional_positive("std"),
        )

    def matches(self) -> PointMatches:
        """The views in the order of their first rows, the points in that of their numbers.

        Raises
        ------
        InputError
            If there are more views and points than can be matches.
        """
        numbers = sorted({number for _, number in self.points})
        if len(self.names) * len(numbers) > _LARGEST:
            raise InputError(
                f"stage {STAGE} has {len(numbers)} points in {len(self.names)} views",
                "leave out points that are seen once, and views that share few",
            )
        column = {number: place for place, number in enumerate(numbers)}
        uv = np.full((len(self.names), len(numbers), 2), np.nan)
        std = np.full(uv.shape[:2], np.nan)
        for (view, number), (u, v, spread) in self.points.items():
            uv[view, column[number]] = u, v
            std[view, column[number]] = np.nan if spread is None else spread
        return PointMatches(tuple(self.names), uv, std, np.array(numbers, dtype=int))


def match_rows(matches: PointMatches) -> list[dict[str, str | int | float]]:
    """A row by column name for every point that was seen.

    Raises
    ------
    InputError
        If a view has no name.
    """
    for name in matches.names:
        if not name or "\0" in name:
            raise InputError(f"a view of stage {STAGE} is called {shown(name)}", "give it a name")
    rows: list[dict[str, str | int | float]] = []
    for view, point in np.argwhere(matches.seen).tolist():
        u, v = matches.uv[view, point].tolist()
        spread = float(matches.stds[view, point])
        row = {"view": matches.names[view], "stage": STAGE, "u": u, "v": v}
        row["marker"] = int(matches.labels[point])
        rows.append(row | ({"std": spread} if np.isfinite(spread) else {}))
    return rows
