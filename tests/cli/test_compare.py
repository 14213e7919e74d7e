"""``sol compare`` as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sheetoflight.cli.main import main

QUICK = ["compare", "--methods", "rod-two-step,camera-free", "--trials", "3", "--seed", "2"]


def test_the_table_is_told_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, page = tmp_path / "c.csv", tmp_path / "c.html"
    assert main([*QUICK, "-o", str(table), "--report", str(page)]) == 0
    told = capsys.readouterr()
    assert "40 pictures each, noise 0.1 px, 3 trials" in told.out
    assert "30 + 10" in told.out
    assert "Errors that the calibration alone causes, mm rms" in told.out
    assert "450 mm" in told.out
    assert f"written to {page}" in told.out
    assert "compare: 3 trials in" in told.err
    assert len(table.read_text().splitlines()) == 1 + 2 * 6
    assert "<h1>Methods compared</h1>" in page.read_text()


def test_the_same_seed_gives_the_same_bytes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = []
    for name in ("one", "two"):
        table, page = tmp_path / f"{name}.csv", tmp_path / f"{name}.html"
        assert main([*QUICK, "-o", str(table), "--report", str(page), "--json"]) == 0
        made.append((table.read_bytes(), page.read_bytes(), capsys.readouterr().out))
    assert made[0] == made[1]
    other = tmp_path / "other.csv"
    assert main([*QUICK[:-1], "3", "-o", str(other)]) == 0
    assert other.read_bytes() != made[0][0]


def test_the_papers_tables_are_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["compare", "--case", "paper", "--methods", "crossing-two-step", "--trials", "2"]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "mean absolute (printed)" in told
    for printed in ("(0.150)", "(0.280)", "(0.390)"):
        assert printed in told


def test_refusals_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    words = [*QUICK[:-4], "--trials", "2", "--distortion", "-0.1", "0", "0", "0", "0", "--json"]
    assert main(words) == 0
    rod, free = json.loads(capsys.readouterr().out)["methods"]
    assert (rod["refused"], free["refused"]) == (0, 2)
    assert "knows no camera and no lens" in free["first_refusal"]


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--methods", "guess"], 2, "method 'guess' cannot be compared"),
        (["--trials", "1"], 2, "trials is 1 – give 2 or more"),
        (["--pixel-std", "-1"], 2, "above zero"),
        (["--case", "other"], 2, "case"),
        (["--scheduler", "nowhere"], 2, "no dask scheduler answers at 'nowhere'"),
        (["-o", "same", "--report", "same"], 2, "both CSV and page"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    words: list[str], status: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    assert main(["compare", *words]) == status
    told = capsys.readouterr()
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert said in told.err


def test_where_all_refuse_the_status_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["compare", "--methods", "camera-free", "--pictures", "1", "--trials", "2"]
    assert main(words) == 3
    assert "every method refused every trial" in capsys.readouterr().err


def test_an_interrupt_leaves_nothing(tmp_path: Path) -> None:
    start = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from sheetoflight.cli.main import run; run()"
    )
    command = subprocess.Popen(
        [sys.executable, "-c", start, "compare", "--trials", "400", "-o", str(tmp_path / "c.csv")],
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    children = Path(f"/proc/{command.pid}/task/{command.pid}/children")
    until = time.monotonic() + 60.0
    while not children.read_text() and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.0)
    os.killpg(command.pid, signal.SIGINT)
    _, error = command.communicate(timeout=60)
    assert command.returncode == 130
    assert error == "error: interrupted – nothing half-written was left\n"
    assert list(tmp_path.iterdir()) == []
