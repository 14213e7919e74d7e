"""What an uncertainty is made of: the parts are all there, and make up the whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t

from sheetoflight.measurement.length import Length
from sheetoflight.report.budget import (
    Budget,
    budget_table,
    freedom_text,
    length_budget,
    parameter_budgets,
    sources_of,
)
from sheetoflight.report.budget_figure import budget_bars
from tests.report.examples import (
    SHARES,
    calibration_of_two_lasers,
    measured,
    picture_pieces,
)

CALIBRATION = calibration_of_two_lasers()


def budgets() -> list[Budget]:
    lengths = [
        length_budget(segment.name, segment.length)
        for plane in CALIBRATION.light_planes
        for segment in measured(CALIBRATION, picture_pieces(plane.name), plane.name)
    ]
    return [*lengths, *parameter_budgets(CALIBRATION.covariance)]


def test_the_parts_add_up_in_squares():
    for budget in budgets():
        assert math.hypot(*dict(budget.shares).values()) == pytest.approx(budget.std)
        assert sum(budget.part(source) for source, _ in budget.shares) == pytest.approx(1.0)


def test_the_printed_parts_add_up_to_the_printed_whole():
    """The whole is rounded by at most 5 %, each part by at most 0.5 % of the whole."""
    table = budget_table(budgets())
    for row in table.rows:
        parts = [float(share.std) for share in row.shares if share.std != "–"]
        assert math.hypot(*parts) == pytest.approx(float(row.std), rel=0.07)
        percent = [float(s.percent.strip("< %")) for s in row.shares if s.percent]
        assert sum(percent) == pytest.approx(100.0, abs=len(percent))


def test_a_parameter_has_the_uncertainty_of_the_covariance():
    covariance = CALIBRATION.covariance
    for place, budget in enumerate(parameter_budgets(covariance)):
        assert budget.name == covariance.parameters[place]
        assert budget.std == pytest.approx(math.sqrt(covariance.matrix[place, place]))
        assert set(dict(budget.shares)) == set(SHARES)


def test_shares_of_one_name_are_one_source():
    """Placement has a share that goes with the rod's ends, and one with single markers."""
    covariance = CALIBRATION.covariance
    both = sum(source.matrix for source in covariance.sources if source.name == "placement")
    (alpha, *_) = parameter_budgets(covariance)
    assert dict(alpha.shares)["placement"] == pytest.approx(math.sqrt(np.asarray(both)[0, 0]))


def test_the_coverage_factor_is_students_quantile():
    row = budget_table([Budget("x", 0.5, (("camera", 0.5),), 7.0)]).rows[0]
    assert float(row.coverage) == pytest.approx(t.ppf(0.975, 7), abs=0.005)
    assert row.freedom == "7.0"
    assert budget_table([Budget("x", 0.5, (("camera", 0.5),))]).rows[0].coverage == "1.96"
    assert [freedom_text(nu) for nu in (math.inf, 1e5, 282.4, 0.1)] == ["∞", "∞", "282", "0.1"]


def test_sources_keep_one_order_and_unknown_ones_come_last():
    made = Budget("x", 1.0, (("image points", 0.6), ("drift", 0.0), ("camera", 0.8)))
    assert sources_of([made]) == ("camera", "image points", "drift")


def test_nothing_known_is_no_nan():
    (row,) = budget_table([length_budget("x", Length(3.0, 0.0, (("calibration", 0.0),)))]).rows
    assert (row.std, [(s.std, s.percent) for s in row.shares]) == ("0", [("0.0", "")])


def test_bars_hold_the_shares_in_per_cent():
    lengths = [one for one in budgets() if one.unit == "mm" and one.name.startswith("bar")]
    figure = budget_bars(lengths)
    total = np.zeros(len(lengths))
    for trace in figure.to_dict()["data"]:
        for place, percent in zip(trace["y"], trace["x"], strict=True):
            total[place] += percent
            share = dict(lengths[place].shares)[trace["name"]] / lengths[place].std
            assert percent == pytest.approx(100.0 * share**2)
    assert total == pytest.approx(100.0)
