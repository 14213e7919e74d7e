"""A comparison of methods as CSV and as a document."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sheetoflight.io.atomic import write_whole
from sheetoflight.io.csv_table import table_text
from sheetoflight.measurement.method_comparison import (
    LengthScore,
    MethodComparison,
    MethodScore,
)

COMPARISON_COLUMNS = (
    "method",
    "length_mm",
    "pictures",
    "trials",
    "refused",
    "normal_deg",
    "plane_mm",
    "rms_mm",
    "predicted_mm",
    "bound_mm",
    "bound_share",
    "bound_share_std",
    "coverage",
    "measured_rms_mm",
    "measured_mean_mm",
    "measured_coverage",
)
"""The header of comparison.csv; docs/comparison.md says what the columns mean."""

_OF_LENGTH = COMPARISON_COLUMNS[7:]


def comparison_csv(comparison: MethodComparison, times: bool = False) -> str:
    """The text of ``comparison.csv``: a row for each method and length, empty where there is
    nothing to be told; with `times` the column ``seconds`` behind the others."""
    rows = [
        [*row, *([_cell(score.seconds)] if times else [])]
        for score in comparison.scores
        for row in _rows(comparison, score)
    ]
    return table_text((*COMPARISON_COLUMNS, *(("seconds",) if times else ())), rows)


def write_comparison(path: str | Path, comparison: MethodComparison, times: bool = False) -> None:
    """Write ``comparison.csv``, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_whole(path, comparison_csv(comparison, times))


def comparison_document(comparison: MethodComparison, times: bool = False) -> dict[str, Any]:
    """A comparison for programs; null stands for what there is not."""
    options = {
        name: value for name, value in asdict(comparison.options).items() if value is not None
    }
    return {"options": options, "methods": [_method(one, times) for one in comparison.scores]}


def _method(score: MethodScore, times: bool) -> dict[str, Any]:
    left_out = set() if times else {"seconds"}
    whole = {**vars(score), "views": dict(score.views)}
    whole["lengths"] = [_finite(vars(length)) for length in score.lengths]
    return _finite({name: value for name, value in whole.items() if name not in left_out})


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in values.items()
    }


def _rows(comparison: MethodComparison, score: MethodScore) -> list[list[str | int | float]]:
    own: dict[float, LengthScore] = {one.length_mm: one for one in score.lengths}
    whole = [sum(score.views.values()), score.trials, score.refused]
    sheet = [_cell(score.normal_deg), _cell(score.plane_mm)]
    return [
        [score.name, float(length), *whole, *sheet, *_figures(own.get(length))]
        for length in comparison.options.lengths
    ]


def _figures(length: LengthScore | None) -> list[str | float]:
    return [_cell(math.nan if length is None else getattr(length, name)) for name in _OF_LENGTH]


def _cell(value: float) -> str | float:
    return float(value) if math.isfinite(value) else ""
