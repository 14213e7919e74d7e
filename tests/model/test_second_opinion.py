"""What a second opinion says in words."""

from __future__ import annotations

import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.second_opinion import Agreement, Opinion, ScaleDifference
from tests.second_opinions import TOO_LARGE, opinion


def test_agreement_is_told_in_millimetres() -> None:
    first, second = opinion().verdict
    assert "agree" in first
    assert "disagree" not in first
    assert "odds 0.85" in first
    assert "differ by 1.1 mm rms, 1.4 mm at most, where 0.7 mm rms are to be expected" in second


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (1.01, "1.00% larger than stated, or the rod shorter"),
        (0.98, "2.00% smaller than stated, or the rod longer"),
    ],
)
def test_a_board_of_the_wrong_size_is_named(size: float, said: str) -> None:
    scale = ScaleDifference(1.0 / size - 1.0, 1e-4, 1e-12, 0.4)
    found = opinion(odds=1e-11, scale=scale)
    assert not found.agrees
    assert found.scale_only
    assert said in found.verdict[1]
    assert "one ruler" in found.verdict[1]


def test_a_scale_that_many_good_parameters_outvote_still_disagrees() -> None:
    assert not opinion(odds=0.01, scale=TOO_LARGE).agrees


def test_the_parameter_that_differs_most_is_named() -> None:
    parameters = (Agreement("camera.alpha", 2300.0, 2290.0, 1.0), Agreement("laser.d", 5.0, 5.1, 1))
    found = opinion(odds=1e-9, parameters=parameters)
    assert not found.scale_only
    assert "camera.alpha differs most, by 10.0 standard uncertainties" in found.verdict[1]


def test_scale_and_more_are_both_told() -> None:
    scale = ScaleDifference(-0.01, 1e-4, 1e-12, 1e-9)
    what, _ = opinion(odds=1e-12, scale=scale).difference
    assert "larger than stated" in what
    assert "differs most" in what


def test_refusals_are_part_of_the_verdict() -> None:
    rod = Opinion("rod", 3, (), "camera stage: why – how")
    found = opinion(rod=rod, parameters=(), sheets=(), scale=None, odds=1.0)
    assert found.agrees
    assert found.verdict == (
        "rod and board have nothing in common that could be compared",
        "the rod alone determines nothing: camera stage: why – how",
    )


def test_opinions_have_their_places() -> None:
    with pytest.raises(InputError, match="board and board"):
        opinion(rod=Opinion("board", 1, ()))
