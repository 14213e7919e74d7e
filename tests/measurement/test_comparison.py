"""Errors of single lengths, and verdicts exactly at their limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.measurement.comparison import (
    Comparison,
    KnownLength,
    MeasuredSegment,
    PermissibleError,
)
from sheetoflight.measurement.length import Length

ENDS = np.array([[900.0, 200.0], [1000.0, 800.0]])


def compared(
    measured: float, known: KnownLength, limit: float | None = None, std: float = 0.1
) -> Comparison:
    return Comparison(MeasuredSegment("bar", ENDS, Length(measured, std)), known, limit)


def test_the_normalised_error_is_the_error_over_its_expanded_uncertainty() -> None:
    one = compared(300.3, KnownLength(300.0, 0.05))
    assert one.error == pytest.approx(0.3)
    assert one.expanded == pytest.approx(1.959964 * math.sqrt(0.1**2 + 0.05**2))
    assert one.normalised_error == pytest.approx(0.3 / one.expanded)
    assert not one.passed
    assert compared(299.79, KnownLength(300.0, 0.05)).passed


def test_without_any_uncertainty_there_is_no_normalised_error() -> None:
    assert compared(300.3, KnownLength(300.0), std=0.0).normalised_error is None


@pytest.mark.parametrize("sign", [1, -1])
def test_an_error_of_exactly_the_limit_passes(sign: int) -> None:
    """300.05 − 300 is 0.0500000000000114 in double precision."""
    known = KnownLength(300.0)
    assert compared(300.0 + sign * 0.05, known, 0.05).passed
    assert not compared(300.0 + sign * 0.0500001, known, 0.05).passed


@pytest.mark.parametrize(
    ("error", "decision"),
    [
        (0.0299, "conformity proven"),
        (0.03, "conformity proven"),
        (0.0301, "not proven"),
        (-0.0699, "not proven"),
        (-0.07, "not proven"),
        (-0.0701, "nonconformity proven"),
    ],
)
def test_the_decision_leaves_room_for_the_known_lengths_uncertainty(
    error: float, decision: str
) -> None:
    """Limit 0.05 mm, the known length's 95 % uncertainty 0.02 mm; the rig's own plays no part."""
    known = KnownLength(300.0, 0.02 / 1.959963984540054)
    assert compared(300.0 + error, known, 0.05).decision == decision
    assert compared(300.0 + error, known, 0.05, std=5.0).decision == decision


def test_a_limit_may_grow_with_the_length() -> None:
    limit = PermissibleError(0.05, per_m=0.1)
    assert limit.at(500.0) == pytest.approx(0.1)
    assert str(limit) == "0.05 mm + 0.1 mm/m × length"
    assert str(PermissibleError(per_m=2.0)) == "2 mm/m × length"


@pytest.mark.parametrize("parts", [(0.0, 0.0), (-0.1, 0.2), (math.nan, 1.0), (0.0, math.inf)])
def test_limits_that_cannot_be(parts: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="permissible"):
        PermissibleError(*parts)


@pytest.mark.parametrize("known", [(0.0, 0.1), (-5.0, 0.0), (math.nan, 0.0), (300.0, -0.1)])
def test_known_lengths_that_cannot_be(known: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="known length"):
        KnownLength(*known)
