"""``sol plan`` as a user meets it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from sheetoflight.cli.main import main
from tests.planned_rigs import write_rig

Words = Callable[..., tuple[int, str, str]]


@pytest.fixture
def sol(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Words:
    """Run ``sol plan`` on a stated rig; give status, standard output and error."""
    path = write_rig(tmp_path)

    def run(*words: object) -> tuple[int, str, str]:
        status = main(["plan", str(path), *map(str, words)])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


def refuse_constant(constant: str) -> None:
    raise AssertionError(constant)


def test_a_plan_is_told(sol: Words) -> None:
    status, out, error = sol("--length-mm", 200, "--wanted-mm", 0.13)
    assert (status, error) == (0, "")
    assert "30 camera views and 10 positions in the sheet, at random" in out
    assert "a length of 200 mm will be known to 0.1" in out
    assert "along the picture's columns" in out
    assert "random positions, with 30 camera views" in out
    assert "in stage plane: lay the target into the sheet of laser with its middle at pixel" in out


def test_what_cannot_be_reached_is_told_with_what_forbids_it(sol: Words) -> None:
    status, out, _ = sol("--length-mm", 200, "--wanted-mm", 0.05)
    assert status == 0
    assert "0.05 mm cannot be reached by any number of views" in out
    assert "image points" in out


def test_json_is_for_programs_and_is_the_file(sol: Words, tmp_path: Path) -> None:
    status, out, _ = sol("--json", "-o", tmp_path / "plan.json", "--best")
    assert status == 0
    printed = json.loads(out, parse_constant=refuse_constant)
    assert printed == json.loads((tmp_path / "plan.json").read_text())
    assert printed["format"] == "sheetoflight.plan"
    assert printed["std_mm"] == printed["expected"]["chosen_mm"] < printed["expected"]["low_mm"]
    assert len(printed["planned_views"]) == 40
    assert [row["plane"] for row in printed["positions"]] == [3, 5, 10, 20, 40]
    assert sol("--json", "--best")[1] == out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--camera-views", -1), "-1, 10 and 0 views"),
        (("--plane-views", 0), "no view shows the sheet of light"),
        (("--plane-views", 5000), "5000 views of one kind are planned"),
        (("--length-mm", 0), "length_mm is 0"),
        (("--length-mm", 9000), "a length of 9000 mm does not fit"),
        (("--wanted-mm", "nan"), "wanted_mm is nan"),
        (("--seed", -1), "seed is -1"),
    ],
    ids=str,
)
def test_bad_usage(sol: Words, words: tuple[object, ...], said: str) -> None:
    status, out, error = sol(*words)
    assert (status, out) == (2, "")
    assert said in error
    assert error.count("\n") == 1


def test_too_few_views_are_status_3(sol: Words) -> None:
    status, out, error = sol("--camera-views", 1, "--plane-views", 1)
    assert (status, out) == (3, "")
    assert "do not determine" in error


def test_an_input_is_never_overwritten(sol: Words, tmp_path: Path) -> None:
    for option in ("--output", "--page"):
        status, _, error = sol(option, tmp_path / "rig.toml")
        assert status == 2
        assert "also an input" in error
    assert sol("-o", tmp_path / "both", "--page", tmp_path / "both")[0] == 2
    assert not (tmp_path / "both").exists()
