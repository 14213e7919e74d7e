"""A Monte Carlo's result that tests share."""

from __future__ import annotations

from typing import Any

from sheetoflight.model.monte_carlo import MonteCarlo, PropagatedLength, PropagatedQuantity

AS_STATED = {
    "value": 400.0,
    "mean_shift": 0.0,
    "std": 0.1,
    "low": 399.8,
    "high": 400.2,
    "analytic_std": 0.1,
    "analytic_low": 399.8,
    "analytic_high": 400.2,
    "coverage": 0.95,
    "std_ratio_std": 0.02,
    "width_ratio_std": 0.03,
    "coverage_std": 0.007,
}


def quantity(name: str = "camera.alpha", **changes: float) -> PropagatedQuantity:
    """A quantity of which everything is as stated but for the changes."""
    return PropagatedQuantity(name, **(AS_STATED | changes))


def length(
    name: str = "400 mm along u", laser: str = "laser", **changes: float
) -> PropagatedLength:
    """The same of a length."""
    ends = ((500.0, 1 / 3), (900.0, 200.0))
    return PropagatedLength(name, **(AS_STATED | changes), laser=laser, uv=ends)


def monte_carlo(**changes: Any) -> MonteCarlo:
    """1000 trials that agree, but for the changes."""
    same: dict[str, Any] = {
        "trials": 1000,
        "refused": 0,
        "first_refusal": "",
        "seed": 0,
        "parameters": (quantity(),),
        "lengths": (length(),),
    }
    return MonteCarlo(**(same | changes))
