"""How ``sol calibrate`` tells what rod and board say alone."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from sheetoflight.cli.telling import plain_table, tell, tell_table
from sheetoflight.io.second_opinion_json import second_opinion_document
from sheetoflight.model.second_opinion import SecondOpinion
from sheetoflight.report.numbers import rounded


def tell_second_opinion(opinion: SecondOpinion) -> None:
    """Print the parameters by either, and the verdict."""
    if opinion.parameters:
        table = plain_table(
            "Rod and board, each solved alone",
            ("parameter",),
            ("rod", "board", "difference", "its uncertainty", "ratio"),
        )
        for one in opinion.parameters:
            values = (rounded(value, one.std)[0] for value in (one.first, one.second))
            table.add_row(
                escape(one.name), *values, *rounded(one.difference, one.std), f"{one.z:+.1f}"
            )
        tell_table(table)
    for sentence in opinion.verdict:
        tell(f"second opinion: {sentence}")


def second_opinion_summary(opinion: SecondOpinion) -> dict[str, Any]:
    """What a program asks for: all of it, as in ``calibration.json``."""
    return second_opinion_document(opinion)
