"""What ``sol calibrate`` prints: every laser, every source, by the names of the file."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from sheetoflight.cli.calibrate import calibration_summary, tell_calibration
from sheetoflight.model.diagnosis import Finding
from tests.report.board_examples import (
    CAMERA_SOURCES,
    COMPONENTS,
    SOURCES,
    board_calibration,
    camera_calibration,
)
from tests.report.examples import (
    NO_COVARIANCE,
    SHARES,
    calibration_of_two_lasers,
    example_calibration,
)

Told = pytest.CaptureFixture[str]


def tables(printed: str) -> dict[str, list[list[str]]]:
    """The rows of each table, the headings first, by its title."""
    found: dict[str, list[list[str]]] = {}
    title = ""
    for line in printed.splitlines():
        if line.startswith(("┃", "│")):
            found[title].append([cell.strip() for cell in line.strip("┃│").split(line[0])])
        elif line[:1].isalpha():
            title = line.strip()
            found[title] = []
    return found


def test_all_lasers_are_printed_with_their_sources(capsys: Told, tmp_path: Path) -> None:
    calibration = calibration_of_two_lasers()
    tell_calibration(calibration)
    printed = tables(capsys.readouterr().out)
    calibration.save(tmp_path / "c.json")
    written = json.loads((tmp_path / "c.json").read_text())["covariance"]
    estimates = printed["Calibration by method joint"]
    assert [row[0] for row in estimates[1:]] == written["parameters"]
    headings, *sources = printed["Standard uncertainty by source"]
    assert headings[1:] == list(dict.fromkeys(source["name"] for source in written["sources"]))
    assert [row[0] for row in sources] == written["parameters"]
    for estimate, source in zip(estimates[1:], sources, strict=True):
        parts = [float(cell) for cell in source[1:]]
        assert math.hypot(*parts) == pytest.approx(float(estimate[2]), rel=0.07)
    noise = [row[0] for row in printed["Noise"][1:]]
    assert noise[:3] == written["noise"]["components"]


def test_programs_get_the_same_by_the_same_names() -> None:
    calibration = calibration_of_two_lasers()
    summary = calibration_summary(calibration)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert [plane["name"] for plane in summary["light_planes"]] == ["left", "right"]
    assert set(summary["noise_std"]) == {"pixel", "placement", "marker"}
    for name, std in summary["std"].items():
        assert set(summary["std_by_source"][name]) == set(SHARES)
        assert math.hypot(*summary["std_by_source"][name].values()) == pytest.approx(std)


def test_programs_get_the_findings(tmp_path: Path) -> None:
    finding = Finding("lens", "unmodelled distortion", "k1", "estimate it", 0.4, 1e-12, 1.5)
    calibration = example_calibration(findings=(finding,))
    calibration.save(tmp_path / "c.json")
    written = json.loads((tmp_path / "c.json").read_text())["findings"]
    assert calibration_summary(calibration)["findings"] == written
    assert (written[0]["cause"], written[0]["explained"]) == ("unmodelled distortion", 0.4)


def test_a_calibration_without_covariance_is_printed(capsys: Told) -> None:
    tell_calibration(example_calibration(covariance=NO_COVARIANCE))
    assert "by source" not in capsys.readouterr().out


def test_boards_are_told_by_the_names_of_the_file(capsys: Told) -> None:
    tell_calibration(board_calibration())
    said = capsys.readouterr().out
    printed = tables(said)
    headings, *_ = printed["Standard uncertainty by source"]
    assert headings[1:] == list(SOURCES)
    noise = {row[0]: row[1:] for row in printed["Noise"][1:]}
    assert list(noise) == [*COMPONENTS, "shape"]
    assert [cells[2] for cells in noise.values()] == ["px", "px", "mm", "px"]
    for name, (size, _) in COMPONENTS.items():
        assert float(noise[name][0]) == pytest.approx(size, rel=0.05)
        assert "estimated" in noise[name][3]
    assert "6 in stage board" in said


def test_a_camera_alone_is_printed(capsys: Told) -> None:
    tell_calibration(camera_calibration())
    printed = tables(capsys.readouterr().out)
    estimates = printed["Calibration by method joint"]
    assert [row[0] for row in estimates[1:]] == [
        f"camera.{name}" for name in ("alpha", "beta", "u0", "v0")
    ]
    assert printed["Standard uncertainty by source"][0][1:] == list(CAMERA_SOURCES)
    assert [row[0] for row in printed["Noise"][1:]] == ["corner"]


def test_programs_are_told_that_there_is_no_sheet() -> None:
    summary = calibration_summary(camera_calibration())
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["light_plane"] is None
    assert summary["light_planes"] == []
    assert set(summary["noise_std"]) == {"corner"}
    assert set(summary["std_by_source"]["camera.alpha"]) == set(CAMERA_SOURCES)
