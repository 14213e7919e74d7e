"""A comparison of methods made by hand, for the tests of what shows it."""

from __future__ import annotations

from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.method_comparison import LengthScore, MethodComparison, MethodScore

OPTIONS = ComparisonOptions(
    methods=("rod-paper", "camera-free", "board-two-step"), lengths_mm=(20.0, 450.0), trials=10
)


def comparison(refusal: str = "too few views", options: ComparisonOptions = OPTIONS):
    """One method with everything, one without a camera, one that refused all."""
    lengths = tuple(
        LengthScore(mm, 0.1 * mm, 0.2 * mm, 0.05 * mm, 0.5, 0.04, 0.9, 0.3, 0.25, 0.94)
        for mm in options.lengths
    )
    rod = MethodScore(
        *("rod-paper", {"camera": 30, "plane": 10}, 10, 1, refusal),
        *(0.05, 1.5, 2.25, 0.5, 0.03, 0.91, 0.95, lengths),
    )
    free = MethodScore(
        *("camera-free", {"plane": 40}, 10, 0),
        seconds=0.01,
        bound_share=0.99,
        bound_share_std=0.1,
        lengths=lengths,
        coverage=0.95,
        measured_coverage=0.96,
    )
    none = MethodScore("board-two-step", {"board": 40}, 10, 10, refusal)
    return MethodComparison(options, (rod, free, none))
