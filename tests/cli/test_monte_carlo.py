"""``sol calibrate --monte-carlo`` as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.cli.main import main
from sheetoflight.io.points_csv import write_points
from sheetoflight.io.rig_toml import write_rig_toml
from sheetoflight.model.board import PlanarBoard
from tests.calibration.boards import rig_of, seen_boards
from tests.calibration.examples import simulated


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A rig folder with points."""
    _, known = simulated(views=(12, 6))
    folder = tmp_path / "rig"
    folder.mkdir()
    write_rig_toml(folder / "rig.toml", known)
    write_points(folder / "points.csv", known.observations)
    return folder


def test_the_comparison_is_told_and_written(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "c.json"
    words = ["calibrate", str(rig), "-o", str(path), "--monte-carlo", "100", "--seed", "4"]
    assert main(words) == 0
    told = capsys.readouterr()
    assert "Monte Carlo: 100 trials, 0 refused" in told.out
    assert "verdict: lengths across the field agree" in told.out
    assert "by chance alone: shift ± 0.10, std ± 0.07" in told.out
    assert "monte carlo: 100 trials in" in told.err
    table = json.loads(path.read_text())["monte_carlo"]
    assert (table["trials"], table["refused"], table["seed"]) == (100, 0, 4)
    assert main([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)["monte_carlo"]
    assert summary["agrees"] is True
    assert summary["verdict"] == table["verdict"]


def test_a_rig_with_boards_is_checked_as_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = PlanarBoard("chessboard", 6, 5, (30.0, 30.0), scale_std=0.002)
    rng = np.random.default_rng(7)
    truth, views = seen_boards(rng, 10, 0.1, 0.2, board, line_points=60)
    known, folder = rig_of(truth, views), tmp_path / "rig"
    folder.mkdir()
    write_rig_toml(folder / "rig.toml", known)
    write_points(folder / "points.csv", known.observations)
    path = tmp_path / "c.json"
    assert main(["calibrate", str(folder), "-o", str(path), "--monte-carlo", "100"]) == 0
    told = capsys.readouterr()
    assert "Monte Carlo: 100 trials, 0 refused" in told.out
    assert "verdict: parameters agree" in told.out
    found = json.loads(path.read_text())
    names = [entry["name"] for entry in found["monte_carlo"]["parameters"]]
    assert names == found["covariance"]["parameters"]


def test_too_few_trials_are_refused_before_anything_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["calibrate", str(tmp_path / "nowhere"), "--monte-carlo", "20"]
    assert main(words) == 2
    assert capsys.readouterr().err.startswith("error: 20 Monte Carlo trials cannot tell")


def test_an_interrupt_leaves_nothing(rig: Path, tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    words = ["calibrate", str(rig), "-o", str(path), "--monte-carlo", "100000"]
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
    assert command.stderr is not None
    # the estimate of the time is told when the calibration itself is done
    assert "will take about" in command.stderr.readline()
    time.sleep(2.0)
    os.killpg(command.pid, signal.SIGINT)
    _, error = command.communicate(timeout=60)
    assert command.returncode == 130
    assert error == "error: interrupted – nothing half-written was left\n"
    assert not path.exists()
