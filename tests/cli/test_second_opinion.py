"""What ``sol calibrate`` prints of a second opinion."""

from __future__ import annotations

import json

import pytest

from sheetoflight.cli.calibrate import calibration_summary, tell_calibration
from tests.report.examples import example_calibration
from tests.second_opinions import opinion


def test_parameters_and_verdict_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    tell_calibration(example_calibration(second_opinion=opinion()))
    printed = capsys.readouterr().out
    row = next(line for line in printed.splitlines() if "562.40" in line)
    cells = [cell.strip() for cell in row.strip("│").split("│")]
    assert cells == ["laser.d", "562.30", "562.40", "0.10", "0.30", "+0.3"]
    assert printed.count("second opinion: ") == 2


def test_programs_get_all_of_it() -> None:
    summary = calibration_summary(example_calibration(second_opinion=opinion()))
    assert json.loads(json.dumps(summary["second_opinion"], allow_nan=False))["agrees"] is True
    assert "second_opinion" not in calibration_summary(example_calibration())
