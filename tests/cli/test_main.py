"""The entry itself: what becomes of output that nobody reads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sheetoflight.cli.main import main
from tests.known_lengths import calibrated, true_ends, write_segments


@pytest.mark.parametrize("words", [["--help"], ["measure", "--help"], ["measure"]], ids=" ".join)
def test_a_reader_that_has_gone_is_no_failure(words: list[str], tmp_path: Path) -> None:
    """As in ``sol --help | head -1``: the status of a program that a closed pipe ended."""
    if words == ["measure"]:
        calibrated().save(tmp_path / "c.json")
        write_segments(tmp_path / "s.csv", true_ends([300.0]), {})
        words = [*words, str(tmp_path / "c.json"), str(tmp_path / "s.csv")]
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "sheetoflight.cli.main", *words],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    finally:
        os.close(writing)
    assert ended.returncode == 141
    assert ended.stderr == ""


@pytest.mark.parametrize("words", [[], ["--method", "paper"]], ids=["defaults", "one method"])
def test_the_demonstration_takes_its_own_defaults(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They come as far as the folder, which holds something else."""
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["demo", str(tmp_path), *words]) == 2
    assert "holds mine.txt" in capsys.readouterr().err
