"""What the residuals point to, on the page."""

from __future__ import annotations

import pytest

from sheetoflight.model.diagnosis import Finding
from sheetoflight.report.diagnosis_block import diagnosis
from sheetoflight.report.page import build_report
from tests.report.examples import example_calibration

HOSTILE = "<script>alert(1)</script>"
BENT = Finding("target", "bent target", "bent by 2 mm", "support it", 0.64, 2.5e-9, 1.2)


def test_a_finding_is_told_with_share_odds_and_remedy():
    (row,) = diagnosis(example_calibration(findings=(BENT,))).findings
    assert (row.stage, row.what, row.explained, row.odds, row.remedy) == (
        *("target", "bent by 2 mm", "64 %", "10⁻⁹", "support it"),
    )


@pytest.mark.parametrize(
    ("odds", "text"), [(1e-5, "10⁻⁵"), (0.9e-5, "10⁻⁶"), (3e-120, "10⁻¹²⁰"), (0.0, "below 10⁻³⁰⁰")]
)
def test_odds_are_told_to_their_order(odds: float, text: str):
    finding = Finding("camera", "slipped pivot", "a", "b", 0.5, odds)
    assert diagnosis(example_calibration(findings=(finding,))).findings[0].odds == text


def test_what_was_left_out_stands_apart_from_other_warnings():
    words = "marker 1 of view 07 of stage camera (12 px off)"
    warnings = ("Few views.", f"left out as wrong: {words}")
    found = diagnosis(example_calibration(warnings=warnings))
    assert found.left_out == (words,)
    assert found.sentence == ""


def test_residuals_that_are_noise_are_said_to_be():
    assert "are noise" in diagnosis(example_calibration(chi2_per_dof=1.0)).sentence


def test_residuals_that_nothing_explains_are_not_called_noise():
    sentence = diagnosis(example_calibration(chi2_per_dof=9.0)).sentence
    assert "larger than the stated noise" in sentence
    assert "are noise" not in sentence


def test_without_views_nothing_is_said_of_residuals():
    assert "no views" in diagnosis(example_calibration(views=())).sentence


def test_the_page_shows_findings_as_text():
    finding = Finding(HOSTILE, "bent target", HOSTILE, HOSTILE, 0.5, 1e-9)
    warnings = (f"left out as wrong: {HOSTILE}",)
    page = build_report(example_calibration(findings=(finding,), warnings=warnings))
    assert "What the residuals point to" in page
    assert "<script>alert" not in page
    assert page.count("&lt;script&gt;alert(1)") >= 5
