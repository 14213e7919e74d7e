"""The second opinion as tables of the page."""

from __future__ import annotations

from sheetoflight.model.second_opinion import Agreement, Opinion
from sheetoflight.report.page import build_report
from sheetoflight.report.second_opinion_block import second_opinion_tables
from tests.report.examples import example_calibration
from tests.second_opinions import opinion


def test_opinions_parameters_and_millimetres_have_a_table_each() -> None:
    found = opinion()
    opinions, parameters, sheets = second_opinion_tables(example_calibration(second_opinion=found))
    assert [row[:3] for row in opinions.rows] == [
        ("rod", 40, "camera, laser"),
        ("board", 8, "camera, laser"),
    ]
    assert "Rod and board, each solved alone, agree" in opinions.note
    assert parameters.rows[1] == ("laser.d", "562.30", "562.40", "0.10", "0.30", "+0.3", "mm")
    assert parameters.highlight == ()
    assert sheets.rows == (("laser", 22, "830", "1461", "1.1", "1.4", "0.70"),)


def test_what_differs_is_set_off() -> None:
    far = (Agreement("camera.alpha", 2300.0, 2300.1, 1.0), Agreement("laser.d", 5.0, 9.0, 1.0))
    _, parameters, _ = second_opinion_tables(
        example_calibration(second_opinion=opinion(parameters=far, odds=1e-6))
    )
    assert parameters.highlight == (1,)


def test_a_refusal_has_its_reason() -> None:
    alone = opinion(rod=Opinion("rod", 3, (), "why"), parameters=(), sheets=(), scale=None)
    (opinions,) = second_opinion_tables(example_calibration(second_opinion=alone))
    assert opinions.rows[0] == ("rod", 3, "nothing", "why")


def test_without_a_second_opinion_there_is_no_table() -> None:
    assert second_opinion_tables(example_calibration()) == ()


def test_the_page_shows_the_tables() -> None:
    page = build_report(example_calibration(second_opinion=opinion()))
    assert page.count("Second opinion: rod and board, each solved alone") == 1
    assert page.count("Points in the sheet by rod and board") == 1
