"""The Monte Carlo check as tables of the page."""

from __future__ import annotations

from sheetoflight.report.monte_carlo_block import monte_carlo_tables
from sheetoflight.report.page import build_report
from tests.monte_carlos import length, monte_carlo, quantity
from tests.report.examples import example_calibration


def test_lengths_come_first_and_each_table_bears_the_verdict() -> None:
    found = monte_carlo()
    lengths, parameters = monte_carlo_tables(example_calibration(monte_carlo=found))
    assert lengths.rows[0][0] == "400 mm along u"
    assert parameters.rows[0][0] == "camera.alpha"
    for table in (lengths, parameters):
        assert "1000 times, 0 of which were refused" in table.note
        assert "agree with what is stated" in table.note
        assert table.highlight == ()


def test_what_differs_is_set_off() -> None:
    found = monte_carlo(
        parameters=(quantity(), quantity("laser.d", std=0.2)),
        lengths=(length(laser="left"), length(laser="right", mean_shift=0.1)),
    )
    lengths, parameters = monte_carlo_tables(example_calibration(monte_carlo=found))
    assert (lengths.highlight, parameters.highlight) == ((1,), (1,))
    assert [row[0] for row in lengths.rows] == ["left: 400 mm along u", "right: 400 mm along u"]
    assert "2.00 ± 0.02" in parameters.rows[1]
    assert lengths.rows[1][2] == "0.10"


def test_without_a_monte_carlo_there_is_no_table() -> None:
    assert monte_carlo_tables(example_calibration()) == ()


def test_the_page_shows_the_tables() -> None:
    calibration = example_calibration(monte_carlo=monte_carlo())
    page = build_report(calibration)
    assert page.count("Lengths, by Monte Carlo and as stated") == 1
