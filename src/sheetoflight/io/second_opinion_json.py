"""The table ``second_opinion`` of ``calibration.json``: rod and board, each solved alone."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from sheetoflight.io.calibration_schema import OpinionPart, SecondOpinionPart
from sheetoflight.model.second_opinion import (
    Agreement,
    Kind,
    Opinion,
    ScaleDifference,
    SecondOpinion,
    SheetAgreement,
)


def second_opinion_document(opinion: SecondOpinion) -> dict[str, Any]:
    """A second opinion as ``calibration.json`` holds it.

    What follows from the other numbers – each parameter's ``difference`` and ``z``, ``agrees``,
    ``verdict`` – stands there for those who read the file, and is not read back.
    """
    known = math.isfinite(opinion.noise_freedom)
    return asdict(opinion) | {
        "noise_freedom": opinion.noise_freedom if known else None,
        "agrees": opinion.agrees,
        "verdict": list(opinion.verdict),
        "parameters": [_agreement_document(one) for one in opinion.parameters],
    }


def second_opinion_from(part: SecondOpinionPart) -> SecondOpinion:
    """The second opinion that a file holds."""
    return SecondOpinion(
        rod=_opinion(part.rod, "rod"),
        board=_opinion(part.board, "board"),
        parameters=tuple(Agreement(**one.model_dump()) for one in part.parameters),
        chi2=part.chi2,
        degrees_of_freedom=part.degrees_of_freedom,
        noise_freedom=math.inf if part.noise_freedom is None else part.noise_freedom,
        odds=part.odds,
        sheets=tuple(SheetAgreement(**one.model_dump()) for one in part.sheets),
        scale=ScaleDifference(**part.scale.model_dump()) if part.scale else None,
    )


def _agreement_document(one: Agreement) -> dict[str, Any]:
    z = one.z if math.isfinite(one.z) else None
    return asdict(one) | {"difference": one.difference, "z": z}


def _opinion(part: OpinionPart, kind: Kind) -> Opinion:
    return Opinion(kind, part.views, tuple(part.determines), part.refusal)
