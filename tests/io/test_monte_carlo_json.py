"""The table ``monte_carlo``: exact round trips, and tables that are none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.calibration_json import read_calibration, write_calibration
from sheetoflight.model.calibration import Calibration
from tests.monte_carlos import length, monte_carlo, quantity

FOUND = monte_carlo(
    refused=1,
    first_refusal="plane stage: why – how",
    parameters=(quantity(value=2298.7 / 3), quantity("laser.d", mean_shift=-1 / 7)),
    lengths=(length(std=0.2 / 3), length(laser="left", coverage=1.0)),
)


@pytest.fixture
def written(tmp_path: Path, calibration: Calibration) -> Path:
    path = tmp_path / "calibration.json"
    write_calibration(path, replace(calibration, monte_carlo=FOUND))
    return path


def test_every_number_comes_back_exactly(written: Path) -> None:
    back = read_calibration(written)
    assert back.monte_carlo == FOUND
    again = written.with_name("again.json")
    write_calibration(again, back)
    assert again.read_bytes() == written.read_bytes()


def test_what_follows_stands_there_for_readers(written: Path) -> None:
    table = json.loads(written.read_text())["monte_carlo"]
    assert table["agrees"] is FOUND.agrees
    assert table["verdict"] == list(FOUND.verdict)
    assert table["lengths"][0]["std_ratio"] == FOUND.lengths[0].std_ratio
    assert table["parameters"][1]["width_ratio"] == FOUND.parameters[1].width_ratio


def test_a_file_without_the_table_is_a_calibration(tmp_path: Path, calibration: Calibration):
    write_calibration(tmp_path / "c.json", calibration)
    assert "monte_carlo" not in json.loads((tmp_path / "c.json").read_text())
    assert read_calibration(tmp_path / "c.json").monte_carlo is None


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda t: t.update(refused=1000), "monte_carlo: 1000 of 1000 trials"),
        (lambda t: t.update(trials=0), "monte_carlo.trials"),
        (
            lambda t: t["lengths"][1].update(analytic_std=0),
            r"monte_carlo.lengths\[1\].analytic_std",
        ),
        (lambda t: t["lengths"][0].update(uv=[[1.0, 2.0]]), r"monte_carlo.lengths\[0\].uv"),
        (lambda t: t["parameters"][0].update(coverage=1.1), r"parameters\[0\].coverage"),
        (lambda t: t["parameters"][0].pop("low"), "'low' is missing"),
        (lambda t: t["parameters"][0].update(analytic_high=0.0), "monte_carlo: camera.alpha"),
    ],
    ids=["all refused", "no trials", "exact", "one end", "coverage", "missing", "turned round"],
)
def test_a_wrong_table_is_named(
    written: Path, change: Callable[[dict[str, Any]], object], named: str
) -> None:
    document = json.loads(written.read_text())
    change(document["monte_carlo"])
    written.write_text(json.dumps(document))
    with pytest.raises(InputError, match=named):
        read_calibration(written)
