"""The commands as a user meets them: what they print, and how they fail."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from sheetoflight.cli.main import COMMANDS, main
from tests.rendered import rendered, rig_folder

__all__ = ["rendered", "rig_folder"]

Words = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def calibration(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("calibration") / "calibration.json"
    assert main(["calibrate", str(rendered), "-o", str(path)]) == 0
    return path


def expect_error(result: tuple[int, str, str], status: int, *said: str) -> None:
    """One line on standard error that says what and how to mend it, and nothing else."""
    found, out, error = result
    assert found == status, error
    assert not out
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert " – " in error
    assert "Traceback" not in error
    for words in said:
        assert words in error


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command: str, sol: Words) -> None:
    status, out, _ = sol(command, "--help")
    assert status == 0
    assert f"Example: sol {command}" in out


def test_three_commands_from_pictures_to_a_length_and_a_report(
    rendered: Path, tmp_path: Path, sol: Words
) -> None:
    found = tmp_path / "calibration.json"
    assert sol("calibrate", rendered, "-o", found)[0] == 0
    lengths = tmp_path / "lengths.csv"
    assert sol("measure", found, rendered / "measure", "-o", lengths)[0] == 0
    header, first, *_ = lengths.read_text().splitlines()
    assert header == "segment,length_mm,std_mm,low_mm,high_mm"
    name, value, _, low, high = first.split(",")
    assert name == "bar00"
    assert float(low) < float(value) < float(high)
    page = tmp_path / "report.html"
    assert sol("report", found, rendered / "measure", "-o", page)[0] == 0
    assert page.stat().st_size > 100_000


@pytest.mark.parametrize("method", ["joint", "two-step", "paper"])
def test_results_can_be_read_by_programs(
    method: str, rendered: Path, tmp_path: Path, sol: Words
) -> None:
    status, out, _ = sol("calibrate", rendered, "-o", tmp_path / "c.json", "--method", method,
                         "--json", "--population", 60, "--generations", 40)  # fmt: skip
    assert status == 0
    document = json.loads(out)
    assert document["method"] == method
    assert document["light_plane"]["distance_mm"] == pytest.approx(562.334, abs=5)
    stored = json.loads((tmp_path / "c.json").read_text())
    assert stored["format"] == "sheetoflight.calibration"


def test_the_same_input_gives_the_same_bytes(rendered: Path, tmp_path: Path, sol: Words) -> None:
    for name in ("one.json", "two.json"):
        words = ("--method", "paper", "--population", 80, "--generations", 60, "--seed", 5)
        assert sol("calibrate", rendered, "-o", tmp_path / name, *words)[0] == 0
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


def test_lengths_are_printed_where_no_file_is_named(
    calibration: Path, tmp_path: Path, sol: Words
) -> None:
    table = tmp_path / "segments.csv"
    table.write_text("segment,u1,v1,u2,v2\nrail,900,300,950,700\n")
    _, out, _ = sol("measure", calibration, table)
    assert "rail" in out
    _, out, _ = sol("measure", calibration, table, "--json")
    (length,) = json.loads(out)["lengths"]
    assert length["low_mm"] < length["length_mm"] < length["high_mm"]


def test_detect_counts_and_names_the_missed(rig_folder: Path, sol: Words) -> None:
    shutil.copy(rig_folder / "measure" / "bar00_off.png", rig_folder / "camera" / "nothing.png")
    status, out, error = sol("detect", rig_folder)
    assert status == 0
    assert "camera: target found in 7 of 8 pictures" in out
    assert "warning: camera/nothing" in error
    status, out, _ = sol("detect", rig_folder, "--json")
    assert [missed["view"] for missed in json.loads(out)["missed"]] == ["nothing"]


# --- bad usage and bad input ------------------------------------------------------------------


@pytest.mark.parametrize(
    "words",
    [
        ("calibrat", "rig"),
        ("calibrate",),
        ("calibrate", "rig", "--method", "magic"),
        ("calibrate", "rig", "--seed", "x"),
        ("calibrate", "rig", "--speed"),
        ("simulate", "rig", "--camera-views", "-3"),
        ("target", "target.docx"),
        ("target", "target.svg", "--markers-mm", "0", "100"),
        ("target", "target.svg", "--page", "a4"),
    ],
    ids=" ".join,
)
def test_bad_usage(
    words: tuple[str, ...], sol: Words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    expect_error(sol(*words), 2)
    assert list(tmp_path.iterdir()) == []


def edited(path: Path, edit: Callable[[list[str]], list[str]]) -> None:
    path.write_text("".join(edit(path.read_text().splitlines(keepends=True))))


def swapped(lines: list[str]) -> list[str]:
    """Markers 1 and 2 exchanged."""
    turn = {"1": "2", "2": "1"}
    cells = [line.split(",") for line in lines]
    return [lines[0], *(",".join([*c[:2], turn.get(c[2], c[2]), *c[3:]]) for c in cells[1:])]


POINTS: dict[str, tuple[Callable[[list[str]], list[str]], int, tuple[str, ...]]] = {
    "nan": (lambda t: [*t[:4], "camera01,camera,2,nan,3.0,\n", *t[5:]], 2, ("line 5",)),
    "text": (lambda t: [*t[:4], "camera01,camera,2,left,3.0,\n", *t[5:]], 2, ("line 5", "left")),
    "markers out of order": (swapped, 2, ("camera00", "marker")),
    "a point twice": (lambda t: [*t, t[-1]], 2, ("twice",)),
    "a copied view": (
        lambda t: [*t, *(x.replace("camera00", "copy") for x in t if "camera00" in x)],
        2,
        ("copy", "camera00"),
    ),
    "no row": (lambda t: t[:1], 2, ("points.csv",)),
    "one view": (lambda t: t[:4], 3, ("plane stage", "0 usable positions")),
    "no camera view": (lambda t: [t[0], *(x for x in t if ",plane," in x)], 3, ("camera stage",)),
    "no plane view": (lambda t: [x for x in t if ",plane," not in x], 3, ("plane stage",)),
    "one plane view": (
        lambda t: [x for x in t if ",plane," not in x or "plane00" in x],
        3,
        ("plane stage",),
    ),
    "another stage": (lambda t: [*t, "b0,board,laser,3.0,4.0,\n"], 2, ("board",)),
}


@pytest.mark.parametrize("case", POINTS)
def test_bad_points(case: str, rig_folder: Path, sol: Words) -> None:
    edit, status, said = POINTS[case]
    edited(rig_folder / "points.csv", edit)
    before = sorted(rig_folder.rglob("*"))
    expect_error(sol("calibrate", rig_folder, "-o", rig_folder / "c.json"), status, *said)
    assert sorted(rig_folder.rglob("*")) == before


RIGS: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    "unknown key": (("markers_mm", "marker_mm"), ("marker_mm", "markers_mm")),
    "wrong image size": (("[1392, 1040]", "[640, 480]"), ("camera00", "640")),
    "two markers": (("[0.0, 200.0, 400.0]", "[0.0, 400.0]"), ("rig.toml", "3")),
    "no TOML": (("[target]", "[target"), ("rig.toml", "line 1")),
    "no such lens": (('"none"', '"fisheye"'), ("distortion", "fisheye")),
}


@pytest.mark.parametrize("case", RIGS)
def test_bad_rigs(case: str, rig_folder: Path, sol: Words) -> None:
    (found, instead), said = RIGS[case]
    path = rig_folder / "rig.toml"
    path.write_text(path.read_text().replace(found, instead))
    expect_error(sol("calibrate", rig_folder, "-o", rig_folder / "c.json"), 2, *said)
    assert not (rig_folder / "c.json").exists()


def test_bad_folders(tmp_path: Path, rendered: Path, sol: Words) -> None:
    expect_error(sol("calibrate", tmp_path / "nowhere"), 2, "nowhere")
    expect_error(sol("calibrate", tmp_path), 2, "rig.toml")
    shutil.copy(rendered / "rig.toml", tmp_path)
    expect_error(sol("calibrate", tmp_path), 2, "camera")
    (tmp_path / "camera").mkdir()
    expect_error(sol("detect", tmp_path), 2, "no picture")
    broken = tmp_path / "camera" / "a.png"
    broken.write_bytes((rendered / "camera" / "camera00.png").read_bytes()[:20_000])
    expect_error(sol("detect", tmp_path), 2, "a.png")
    broken.write_text("no picture")
    expect_error(sol("detect", tmp_path), 2, "a.png")
    shutil.copy(rendered / "measure" / "bar00_off.png", broken)
    expect_error(sol("detect", tmp_path), 3, "a.png")
    assert not (tmp_path / "points.csv").exists()


SEGMENTS = {
    "off the picture": ("rail,900,300,950,5000", ("rail", "point 2", "outside")),
    "text": ("rail,900,300,here,700", ("line 2", "here")),
    "one point": ("rail,900,300,900,300", ("rail", "same")),
    "too few cells": ("rail,900,300,950", ("line 2",)),
}


@pytest.mark.parametrize("case", SEGMENTS)
def test_bad_segments(case: str, calibration: Path, tmp_path: Path, sol: Words) -> None:
    row, said = SEGMENTS[case]
    (tmp_path / "segments.csv").write_text(f"segment,u1,v1,u2,v2\n{row}\n")
    lengths = tmp_path / "lengths.csv"
    result = sol("measure", calibration, tmp_path / "segments.csv", "-o", lengths)
    expect_error(result, 2, *said)
    assert not lengths.exists()


def test_a_segment_that_looks_away_from_the_sheet(
    calibration: Path, tmp_path: Path, sol: Words
) -> None:
    document = json.loads(calibration.read_text())
    document["light_planes"][0] |= {"normal": [1.0, 0.0, 0.0], "distance_mm": 500.0}
    turned = tmp_path / "turned.json"
    turned.write_text(json.dumps(document))
    (tmp_path / "segments.csv").write_text("segment,u1,v1,u2,v2\nrail,900,300,20,300\n")
    expect_error(sol("measure", turned, tmp_path / "segments.csv"), 2, "rail", "behind the camera")


def test_bad_calibrations(calibration: Path, rendered: Path, tmp_path: Path, sol: Words) -> None:
    cut = tmp_path / "cut.json"
    cut.write_text(calibration.read_text()[:3000])
    for path, said in ((cut, "cut.json"), (rendered / "truth.json", "truth.json"),
                       (tmp_path / "none.json", "none.json")):  # fmt: skip
        expect_error(sol("measure", path, rendered / "measure"), 2, said)
        expect_error(sol("report", path, "-o", tmp_path / "report.html"), 2, said)
    assert not (tmp_path / "report.html").exists()


def test_pictures_without_a_line_give_no_length(
    calibration: Path, rendered: Path, tmp_path: Path, sol: Words
) -> None:
    lengths = tmp_path / "lengths.csv"
    off = rendered / "measure" / "bar00_off.png"
    expect_error(sol("measure", calibration, off, "-o", lengths), 3, "line")
    assert not lengths.exists()


def test_a_folder_that_cannot_be_written(calibration: Path, tmp_path: Path, sol: Words) -> None:
    expect_error(
        sol("report", calibration, "-o", tmp_path / "no" / "report.html"), 2, "report.html"
    )


@pytest.mark.parametrize(
    "words",
    [
        ("--population", "0"),
        ("--generations", "-3"),
        ("--seed", "-1"),
        ("--threshold", "0"),
        ("--threshold", "nan"),
    ],
    ids=" ".join,
)
def test_searches_that_cannot_be(
    words: tuple[str, ...], rendered: Path, tmp_path: Path, sol: Words
) -> None:
    result = sol("calibrate", rendered, "-o", tmp_path / "c.json", "--method", "paper", *words)
    expect_error(result, 2, "give")
    assert not (tmp_path / "c.json").exists()


def test_a_search_cut_short_is_no_result(rendered: Path, tmp_path: Path, sol: Words) -> None:
    words = ("--method", "paper", "--population", 2, "--generations", 1)
    result = sol("calibrate", rendered, "-o", tmp_path / "c.json", *words)
    expect_error(result, 3, "genetic search", "--generations")


def test_an_input_is_never_overwritten(calibration: Path, rig_folder: Path, sol: Words) -> None:
    table = rig_folder / "segments.csv"
    table.write_text("segment,u1,v1,u2,v2\nrail,900,300,950,700\n")
    before = {path: path.read_bytes() for path in (calibration, table, rig_folder / "rig.toml")}
    for output in before:
        expect_error(sol("measure", calibration, table, "-o", output), 2, output.name)
        expect_error(sol("calibrate", rig_folder, "-o", rig_folder / "points.csv"), 2)
    assert {path: path.read_bytes() for path in before} == before


def test_a_view_of_the_other_stage_is_named(rig_folder: Path, sol: Words) -> None:
    edited(
        rig_folder / "points.csv",
        lambda lines: [*lines, *(line.replace("plane01,plane", "stray,camera")
                                 for line in lines if "plane01" in line)],
    )  # fmt: skip
    status, _, error = sol("calibrate", rig_folder, "-o", rig_folder / "c.json")
    assert status == 0
    assert "warning: left out as wrong: view stray of stage camera" in error


def test_a_marker_that_is_off_is_named(rig_folder: Path, sol: Words) -> None:
    def shifted(lines: list[str]) -> list[str]:
        cells = [line.split(",") for line in lines]
        return [
            ",".join([*c[:3], str(float(c[3]) + 15.0), *c[4:]])
            if c[:3] == ["camera03", "camera", "2"]
            else ",".join(c)
            for c in cells
        ]

    edited(rig_folder / "points.csv", shifted)
    status, _, error = sol("calibrate", rig_folder, "-o", rig_folder / "c.json")
    assert status == 0
    assert "warning: left out as wrong: marker" in error
    assert "2 of view camera03 of stage camera" in error


def test_an_interrupt_ends_everything_and_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C in mid-rendering, as a terminal sends it: to the command and all its processes."""
    words = ["simulate", str(tmp_path / "rig"), "--camera-views", "60", "--plane-views", "0"]
    # a shell starts background jobs with interrupts ignored, and children inherit that
    start = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from sheetoflight.cli.main import run; run()"
    )
    command = subprocess.Popen(
        [sys.executable, "-c", start, *words],
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.rglob("*.png")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(command.pid, signal.SIGINT)
    _, error = command.communicate(timeout=60)
    assert command.returncode == 130
    assert error == "error: interrupted – nothing half-written was left\n"
    assert list(tmp_path.iterdir()) == []
