"""The table ``second_opinion``: exact round trips, and tables that are none."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.calibration_json import read_calibration, write_calibration
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.second_opinion import Opinion, SecondOpinion
from tests.second_opinions import TOO_LARGE, opinion

NOTHING = opinion(
    rod=Opinion("rod", 3, (), "camera stage: why – how"),
    parameters=(),
    sheets=(),
    scale=None,
    noise_freedom=math.inf,
    degrees_of_freedom=0,
    odds=1.0,
    chi2=0.0,
)


@pytest.mark.parametrize("found", [opinion(), opinion(scale=TOO_LARGE), NOTHING])
def test_every_number_comes_back_exactly(
    tmp_path: Path, calibration: Calibration, found: SecondOpinion
) -> None:
    path = tmp_path / "calibration.json"
    write_calibration(path, replace(calibration, second_opinion=found))
    back = read_calibration(path)
    assert back.second_opinion == found
    write_calibration(tmp_path / "again.json", back)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_what_follows_stands_there_for_readers(tmp_path: Path, calibration: Calibration) -> None:
    found = opinion(scale=TOO_LARGE)
    write_calibration(tmp_path / "c.json", replace(calibration, second_opinion=found))
    table = json.loads((tmp_path / "c.json").read_text())["second_opinion"]
    assert table["agrees"] is False
    assert table["verdict"] == list(found.verdict)
    assert table["parameters"][1]["z"] == found.parameters[1].z
    assert table["parameters"][0]["difference"] == found.parameters[0].difference


def test_a_file_without_the_table_is_a_calibration(
    tmp_path: Path, calibration: Calibration
) -> None:
    write_calibration(tmp_path / "c.json", calibration)
    assert "second_opinion" not in json.loads((tmp_path / "c.json").read_text())
    assert read_calibration(tmp_path / "c.json").second_opinion is None


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda t: t.update(odds=1.5), "second_opinion.odds"),
        (lambda t: t["rod"].pop("views"), "second_opinion.rod"),
        (lambda t: t["parameters"][1].update(std=-1.0), r"parameters\[1\].std"),
        (lambda t: t["sheets"][0].update(points=0), r"sheets\[0\].points"),
        (lambda t: t["scale"].update(relative=-1.0), "scale.relative"),
    ],
    ids=["odds", "missing", "std", "points", "scale"],
)
def test_a_wrong_table_is_named(
    tmp_path: Path,
    calibration: Calibration,
    change: Callable[[dict[str, Any]], object],
    named: str,
) -> None:
    path = tmp_path / "c.json"
    write_calibration(path, replace(calibration, second_opinion=opinion()))
    document = json.loads(path.read_text())
    change(document["second_opinion"])
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=named):
        read_calibration(path)
