"""What the comparison of a Monte Carlo with stated uncertainties says."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sheetoflight.errors import InputError
from tests.monte_carlos import length, monte_carlo, quantity


def test_what_is_as_stated_agrees() -> None:
    found = monte_carlo()
    assert found.agrees
    assert found.differences == ()
    assert len(found.verdict) == 2
    assert all("agree with what is stated" in sentence for sentence in found.verdict)


def test_ratios_are_of_what_was_found_to_what_was_stated() -> None:
    found = quantity(std=0.15, mean_shift=-0.02, low=399.7, high=400.2)
    assert found.std_ratio == pytest.approx(1.5)
    assert found.width_ratio == pytest.approx(1.25)
    assert found.relative_shift == pytest.approx(-0.2)


@pytest.mark.parametrize(
    "change",
    [
        {"std": 0.1 * 1.14},  # 5 % tolerance and four times 2 %
        {"std": 0.1 * 0.86},
        {"coverage": 0.95 - 0.041},  # 1.2 % and four times 0.7 %
        {"coverage": 0.95 + 0.041},
        {"mean_shift": 0.1 * 0.22},  # 10 % and four times √2 · 2 %
    ],
    ids=["wider", "narrower", "too short", "too long", "shifted"],
)
def test_a_difference_counts_beyond_tolerance_and_chance(change: dict[str, float]) -> None:
    found = monte_carlo(lengths=(length("good"), replace(length("bad"), **change)))
    assert not found.agrees
    (sentence,) = found.differences
    assert sentence.startswith("by Monte Carlo 1 of 2 lengths across the field differ")
    assert "bad: standard uncertainty" in sentence


def test_a_difference_within_what_chance_allows_is_none() -> None:
    inside: dict[str, float] = {
        "std": 0.1 * 1.12,
        "coverage": 0.95 - 0.039,
        "mean_shift": 0.1 * 0.2,
    }
    assert monte_carlo(parameters=(replace(quantity(), **inside),)).agrees


def test_refused_trials_are_told_and_more_than_a_few_are_a_difference() -> None:
    few = monte_carlo(refused=10, first_refusal="too few views – take more")
    assert few.agrees
    assert "10 of 1000 Monte Carlo trials were refused (1.0%)" in few.verdict[-1]
    assert few.verdict[-1].endswith("the first: too few views – take more")
    many = monte_carlo(refused=11, first_refusal="too few views – take more")
    assert not many.agrees
    assert many.differences == many.verdict[-1:]


def test_nothing_compares_with_what_is_exact() -> None:
    with pytest.raises(InputError, match="exact"):
        quantity(analytic_std=0.0)
    with pytest.raises(InputError, match="exact"):
        quantity(analytic_high=399.8)


def test_not_all_trials_may_be_refused() -> None:
    with pytest.raises(InputError, match="1000 of 1000"):
        monte_carlo(refused=1000)
