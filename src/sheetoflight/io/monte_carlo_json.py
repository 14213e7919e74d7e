"""The table ``monte_carlo`` of ``calibration.json``: what re-simulated calibrations say."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from sheetoflight.io.calibration_schema import (
    MonteCarloPart,
    PropagatedLengthPart,
)
from sheetoflight.io.reading import naming
from sheetoflight.model.monte_carlo import MonteCarlo, PropagatedLength, PropagatedQuantity


def monte_carlo_document(monte_carlo: MonteCarlo) -> dict[str, Any]:
    """A Monte Carlo as ``calibration.json`` holds it.

    What follows from the other numbers – the ratios, whether they agree, the verdict – stands
    there for those who read the file, and is not read back.
    """
    return {
        "trials": monte_carlo.trials,
        "refused": monte_carlo.refused,
        "first_refusal": monte_carlo.first_refusal,
        "seed": monte_carlo.seed,
        "agrees": monte_carlo.agrees,
        "verdict": monte_carlo.verdict,
        "parameters": [_quantity_document(one) for one in monte_carlo.parameters],
        "lengths": [_quantity_document(one) for one in monte_carlo.lengths],
    }


def monte_carlo_from(part: MonteCarloPart) -> MonteCarlo:
    """The Monte Carlo that a file holds.

    Raises
    ------
    InputError
        If more trials were refused than made, or a quantity is stated to be exact.
    """
    with naming("monte_carlo"):
        return MonteCarlo(
            trials=part.trials,
            refused=part.refused,
            first_refusal=part.first_refusal,
            seed=part.seed,
            parameters=tuple(PropagatedQuantity(**one.model_dump()) for one in part.parameters),
            lengths=tuple(_length(one) for one in part.lengths),
        )


def _quantity_document(quantity: PropagatedQuantity) -> dict[str, Any]:
    ratios = {"std_ratio": quantity.std_ratio, "width_ratio": quantity.width_ratio}
    return asdict(quantity) | ratios


def _length(part: PropagatedLengthPart) -> PropagatedLength:
    (u1, v1), (u2, v2) = part.uv
    return PropagatedLength(**part.model_dump(exclude={"uv"}), uv=((u1, v1), (u2, v2)))
