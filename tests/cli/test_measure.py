"""``sol measure`` and ``sol report`` as a user meets them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from sheetoflight.cli.main import main
from sheetoflight.workflow.simulated import SimulationOptions, simulate
from tests.known_lengths import calibrated, true_ends, write_segments
from tests.report.examples import RIG_OF_TWO, SHARES, calibration_of_two_lasers

Told = pytest.CaptureFixture[str]


@pytest.fixture
def two(tmp_path: Path) -> Path:
    calibration_of_two_lasers().save(tmp_path / "two.json")
    return tmp_path / "two.json"


def refuse_constant(constant: str) -> None:
    raise AssertionError(constant)


def test_json_holds_laser_freedom_and_budget(two: Path, tmp_path: Path, capsys: Told) -> None:
    table = tmp_path / "segments.csv"
    table.write_text(
        "segment,u1,v1,u2,v2,laser\nrail,900,300,950,700,left\ngap,400,300,420,700,right\n"
    )
    assert main(["measure", str(two), str(table), "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=refuse_constant)["lengths"]
    assert [one["laser"] for one in found] == ["left", "right"]
    for one in found:
        assert list(one["budget_mm"]) == [*SHARES, "image points"]
        assert math.hypot(*one["budget_mm"].values()) == pytest.approx(one["std_mm"])
        assert one["degrees_of_freedom"] > 1
        reach = (one["high_mm"] - one["low_mm"]) / 2 / one["std_mm"]
        assert reach > 1.96


def test_stated_noise_has_no_degrees_of_freedom(tmp_path: Path, capsys: Told) -> None:
    """JSON has no infinity."""
    calibrated().save(tmp_path / "c.json")
    write_segments(tmp_path / "segments.csv", true_ends([300.0]), {})
    assert (
        main(["measure", str(tmp_path / "c.json"), str(tmp_path / "segments.csv"), "--json"]) == 0
    )
    (one,) = json.loads(capsys.readouterr().out, parse_constant=refuse_constant)["lengths"]
    assert one["degrees_of_freedom"] is None


def test_names_are_printed_letter_by_letter(two: Path, tmp_path: Path, capsys: Told) -> None:
    table = tmp_path / "segments.csv"
    table.write_text("segment,u1,v1,u2,v2\n[b]rail[/],900,300,950,700\n[/red],900,300,950,701\n")
    assert main(["measure", str(two), str(table), "--laser", "left"]) == 0
    out = capsys.readouterr().out
    assert "[b]rail[/]" in out
    assert "[/red]" in out


def test_a_laser_must_be_named_where_there_are_several(
    two: Path, tmp_path: Path, capsys: Told
) -> None:
    simulate(tmp_path / "rig", SimulationOptions(1, 0, (150.0,), clutter=0))
    pictures = str(tmp_path / "rig" / "measure")
    for command in ("measure", "report"):
        words = [command, str(two), pictures, "-o", str(tmp_path / command)]
        assert main(words) == 2
        assert "left and right" in capsys.readouterr().err
        assert not (tmp_path / command).exists()
        assert main([*words, "--laser", "left"]) == 0
    assert (tmp_path / "measure").read_text().splitlines()[1].startswith("bar00,")
    assert RIG_OF_TWO.light_planes[0].name == "left"


def test_a_segment_has_one_name_in_lengths_csv_and_report(tmp_path: Path) -> None:
    """A single picture, in which further things look like pieces of the line."""
    calibrated().save(tmp_path / "c.json")
    simulate(tmp_path / "rig", SimulationOptions(1, 0, (150.0, 300.0), seed=3))
    pictures = [str(path) for path in sorted((tmp_path / "rig" / "measure").glob("*_on.png"))]
    words = [str(tmp_path / "c.json"), *pictures, "-o"]
    assert main(["measure", *words, str(tmp_path / "lengths.csv")]) == 0
    assert main(["report", *words, str(tmp_path / "report.html")]) == 0
    rows = (tmp_path / "lengths.csv").read_text().splitlines()[1:]
    page = (tmp_path / "report.html").read_text()
    shown = re.findall(
        r"<tr><td>\d+</td><td>([^<]+)</td><td class=\"number\">\d+</td>"
        r"<td class=\"number\"><strong>([\d.]+)</strong>",
        page,
    )
    assert [name for name, _ in shown] == [row.split(",")[0] for row in rows]
    for (_, length), row in zip(shown, rows, strict=True):
        assert float(length) == pytest.approx(float(row.split(",")[1]), abs=0.5)
