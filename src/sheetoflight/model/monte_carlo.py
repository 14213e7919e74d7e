"""What re-simulated calibrations say of the stated uncertainties."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sheetoflight.errors import InputError

TOLERANCE = 0.05
"""Relative difference of standard uncertainties that is none."""

COVERAGE = 0.95
"""Share of trials whose stated interval should hold the truth."""

COVERAGE_TOLERANCE = 0.012
"""The difference of it that is none: an interval 5 % too narrow holds so much less."""

SHIFT_TOLERANCE = 0.1
"""The same for a mean shift, in standard uncertainties."""

CHANCE = 4.0
"""Standard deviations of the Monte Carlo itself that a difference must exceed beside that: one
comparison in 16 000 does so by chance."""

FEW = 0.01
"""Share of refused trials up to which the others stand for all."""


@dataclass(frozen=True)
class PropagatedQuantity:
    """One quantity, by Monte Carlo and as it was stated.

    Parameters
    ----------
    name : str
        What it is: a parameter's name, or a length in words.
    value : float
        As calibrated, from which every trial was simulated.
    mean_shift : float
        Mean of the trials' results, less `value`.
    std : float
        Their standard deviation.
    low, high : float
        Ends of the 95 % interval by Monte Carlo (studentised: docs/uncertainty.md).
    analytic_std, analytic_low, analytic_high : float
        Standard uncertainty and 95 % interval as stated by the calibration.
    coverage : float
        Share of trials whose own stated 95 % interval held the value they were simulated from.
    std_ratio_std, width_ratio_std, coverage_std : float
        How far chance alone moves `std_ratio`, `width_ratio` and `coverage` from one Monte Carlo
        to the next.

    Raises
    ------
    InputError
        If nothing is stated to compare with: a standard uncertainty or an interval of width 0.
    """

    name: str
    value: float
    mean_shift: float
    std: float
    low: float
    high: float
    analytic_std: float
    analytic_low: float
    analytic_high: float
    coverage: float
    std_ratio_std: float
    width_ratio_std: float
    coverage_std: float

    def __post_init__(self) -> None:
        if not (self.analytic_std > 0 and self.analytic_high > self.analytic_low):
            raise InputError(
                f"{self.name} is stated to be exact: no Monte Carlo compares with that",
                "leave it out",
            )

    @property
    def std_ratio(self) -> float:
        """Standard deviation of the trials over the stated standard uncertainty."""
        return self.std / self.analytic_std

    @property
    def width_ratio(self) -> float:
        """Width of the 95 % interval by Monte Carlo over the stated one's."""
        return (self.high - self.low) / (self.analytic_high - self.analytic_low)

    @property
    def relative_shift(self) -> float:
        """Mean shift in stated standard uncertainties."""
        return self.mean_shift / self.analytic_std

    @property
    def shift_std(self) -> float:
        """How far chance alone moves `relative_shift`."""
        # a sample's mean scatters by u / √n, its standard deviation by u / √(2 n)
        return math.sqrt(2.0) * self.std_ratio_std

    @property
    def excess(self) -> float:
        """The largest difference from what was stated, in units of what is allowed: tolerance
        and chance together.

        Whether the interval holds is judged by its coverage, a mere count: the ends of the one by
        Monte Carlo are among the outermost results, which scatter far to one side.
        """
        return max(
            abs(self.std_ratio - 1.0) / (TOLERANCE + CHANCE * self.std_ratio_std),
            abs(self.coverage - COVERAGE) / (COVERAGE_TOLERANCE + CHANCE * self.coverage_std),
            abs(self.relative_shift) / (SHIFT_TOLERANCE + CHANCE * self.shift_std),
        )

    @property
    def difference(self) -> str:
        """The differences from what was stated, in words."""
        return (
            f"{self.name}: standard uncertainty {self.std_ratio:.2f} ± {self.std_ratio_std:.2f} "
            f"times as large, 95 % interval {self.width_ratio:.2f} ± {self.width_ratio_std:.2f} "
            f"times as wide, mean shifted by {self.relative_shift:+.2f} standard uncertainties; "
            f"the stated interval holds the truth in {self.coverage:.1%} ± {self.coverage_std:.1%}"
        )


@dataclass(frozen=True)
class PropagatedLength(PropagatedQuantity):
    """A length between two fixed image points; image noise of these points is in neither
    uncertainty.

    Parameters
    ----------
    laser : str
        In whose sheet it lies.
    uv : ((u, v), (u, v))
        Its ends, px.
    """

    laser: str
    uv: tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class MonteCarlo:
    """The rig re-simulated and calibrated again, many times.

    Parameters
    ----------
    trials : int
        How many.
    refused : int
        Trials that the calibration refused; they are in no statistic.
    first_refusal : str
        Why, of the first of these; empty where there is none.
    seed : int
    parameters : tuple of PropagatedQuantity
        Those of the covariance.
    lengths : tuple of PropagatedLength
        Across the field.

    Raises
    ------
    InputError
        If more trials were refused than made.
    """

    trials: int
    refused: int
    first_refusal: str
    seed: int
    parameters: tuple[PropagatedQuantity, ...]
    lengths: tuple[PropagatedLength, ...]

    def __post_init__(self) -> None:
        if not 0 <= self.refused < self.trials:
            raise InputError(
                f"{self.refused} of {self.trials} trials were refused",
                "give fewer refused trials than trials",
            )

    @property
    def refused_share(self) -> float:
        """Share of the trials that were refused."""
        return self.refused / self.trials

    @property
    def agrees(self) -> bool:
        """Whether what is stated of parameters and lengths holds."""
        return not self.differences

    @property
    def differences(self) -> tuple[str, ...]:
        """Sentences of the verdict that a careful user should know."""
        differing = [
            _said(what, quantities)
            for what, quantities in self._groups().items()
            if _worst(quantities).excess > 1.0
        ]
        refusals = [self._refusals()] if self.refused_share > FEW else []
        return (*differing, *refusals)

    @property
    def verdict(self) -> tuple[str, ...]:
        """What the comparison says, in sentences."""
        said = [_said(what, quantities) for what, quantities in self._groups().items()]
        return (*said, self._refusals()) if self.refused else tuple(said)

    def _groups(self) -> dict[str, Sequence[PropagatedQuantity]]:
        groups = {"lengths across the field": self.lengths, "parameters": self.parameters}
        return {what: quantities for what, quantities in groups.items() if quantities}

    def _refusals(self) -> str:
        meaning = (
            "few enough for the others to stand for all"
            if self.refused_share <= FEW
            else "the views determine the rig only just, and the others show it better than it is"
        )
        return (
            f"{self.refused} of {self.trials} Monte Carlo trials were refused "
            f"({self.refused_share:.1%}), {meaning}; the first: {self.first_refusal}"
        )


def _worst(quantities: Sequence[PropagatedQuantity]) -> PropagatedQuantity:
    return max(quantities, key=lambda quantity: quantity.excess)


def _said(what: str, quantities: Sequence[PropagatedQuantity]) -> str:
    worst = _worst(quantities)
    if worst.excess > 1.0:
        number = sum(quantity.excess > 1.0 for quantity in quantities)
        return (
            f"by Monte Carlo {number} of {len(quantities)} {what} differ from what is stated, most "
            f"of all {worst.difference}"
        )
    ratios = [quantity.std_ratio for quantity in quantities]
    coverages = [quantity.coverage for quantity in quantities]
    return (
        f"{what} agree with what is stated: standard uncertainties {min(ratios):.2f} to "
        f"{max(ratios):.2f} times as large (by chance alone 1 ± {worst.std_ratio_std:.2f}); the "
        f"stated 95 % intervals hold the truth in {min(coverages):.1%} to {max(coverages):.1%} of "
        f"the trials (± {worst.coverage_std:.1%})"
    )
