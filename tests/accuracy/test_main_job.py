"""The main job from rendered pictures, and the price of asking for help."""

from __future__ import annotations

import pytest

from bench.pictures import demonstrations
from bench.startup import help_ratio


@pytest.mark.accuracy
def test_lengths_from_rendered_pictures() -> None:
    """Table 2's lengths to 0.10 mm by the joint method, against the paper's 0.125 mm, and the
    joint method ahead of the paper's on the same pictures."""
    (found,) = demonstrations(1)
    assert found.missed == 0
    assert sum(c.table == "Table 2" for c in found.comparisons) == 6
    assert found.mean_error_mm("Table 2", "joint") <= 0.10
    assert found.mean_error_mm("Table 2", "joint") < found.mean_error_mm("Table 2", "paper")


def test_help_is_quick() -> None:
    assert help_ratio(rounds=5) <= 3
