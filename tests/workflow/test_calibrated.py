"""A rig calibrated with its second opinion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sheetoflight as sol
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.board_views import BoardViews
from sheetoflight.workflow.calibrated import calibrate
from tests.second_opinions import rod_and_board


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_rod_and_board_are_compared(method: str) -> None:
    _, rig = rod_and_board(0)
    found = calibrate(rig, method)
    opinion = found.second_opinion
    assert opinion is not None
    assert opinion.agrees
    assert not any("each solved alone" in warning for warning in found.warnings)
    # together they know more than either
    for one in opinion.parameters:
        assert found.covariance.std(one.name) < one.std


def test_a_contradiction_is_refused_with_its_cause() -> None:
    _, rig = rod_and_board(0, board_size=1.01)
    with pytest.raises(UntrustworthyError, match="each solved alone, disagree") as told:
        sol.calibrate(rig)
    assert "larger than stated, or the rod shorter" in told.value.what
    assert "one ruler" in told.value.remedy
    assert isinstance(told.value.__cause__, UntrustworthyError)


def test_a_difference_that_the_joint_result_bears_is_a_warning() -> None:
    """A board 0.06 % too large: six standard uncertainties of the scale."""
    _, rig = rod_and_board(0, board_size=1.0006)
    found = calibrate(rig)
    assert found.second_opinion is not None
    assert not found.second_opinion.agrees
    assert any("larger than stated" in warning for warning in found.warnings)


def test_refusals_with_one_kind_are_left_as_they_are() -> None:
    _, rig = rod_and_board(0)
    seen = rig.observations
    few = replace(seen, board=BoardViews(), plane=seen.plane.take(np.arange(1)))
    with pytest.raises(UntrustworthyError) as told:
        calibrate(replace(rig, observations=few))
    assert "each solved alone" not in told.value.what
