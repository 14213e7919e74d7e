"""``sol verify`` as a user meets it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sheetoflight.cli.main import main
from sheetoflight.model.light_plane import LightPlane
from tests.known_lengths import RIG, calibrated, true_ends, write_segments

Words = Callable[..., tuple[int, str, str]]
BARS_MM = [150.0, 300.0, 450.0]


@pytest.fixture
def sol(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Words:
    """Run ``sol verify`` on three exact bars; give status, standard output and error."""
    calibrated().save(tmp_path / "calibration.json")
    write_segments(tmp_path / "segments.csv", true_ends(BARS_MM), {})

    def run(*words: object, known: str = "s0,150\ns1,300\ns2,450\n") -> tuple[int, str, str]:
        (tmp_path / "known.csv").write_text(f"segment,known_mm\n{known}")
        given = [str(word) for word in words]
        files = [str(tmp_path / name) for name in ("calibration.json", "segments.csv")]
        if "--known" not in given:
            given += ["--known", str(tmp_path / "known.csv")]
        status = main(["verify", *files, *given])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


def test_a_rig_that_measures_right_passes(sol: Words) -> None:
    status, out, error = sol()
    assert (status, error) == (0, "")
    assert "PASS: |E_n| ≤ 1 for 3 of 3" in out
    assert "scale error" not in out


def test_failing_is_status_4_and_everything_is_written_all_the_same(
    sol: Words, tmp_path: Path
) -> None:
    result, page = tmp_path / "result.json", tmp_path / "page.html"
    words = ("--mpe-mm", 0.1, "-o", result, "--page", page)
    status, out, error = sol(*words, known="s0,150\ns1,300.25\ns2,449.8\n")
    assert status == 4
    assert error.count("\n") == 1
    assert error.startswith("error: 2 of 3 lengths fail; worst is segment s1, its error -0.2500 mm")
    assert " – " in error
    assert "FAIL: |error| ≤ 0.1 mm for 1 of 3" in out
    assert not json.loads(result.read_text())["passed"]
    assert "Verification: failed" in page.read_text()


def test_without_a_limit_the_stated_uncertainties_are_the_limit(sol: Words) -> None:
    status, _, error = sol(known="s0,150\ns1,330\ns2,450\n")
    assert status == 4
    assert "against its 95 % uncertainty" in error


def test_a_limit_that_grows_with_the_length(sol: Words) -> None:
    known = "s0,150.05\ns1,300.1\ns2,450.4\n"
    assert sol("--mpe-mm", 0.05, "--mpe-per-m", 0.8, known=known)[0] == 0
    assert sol("--mpe-mm", 0.05, "--mpe-per-m", 0.7, known=known)[0] == 4


def test_a_scale_error_is_named(sol: Words) -> None:
    _, out, _ = sol(known="s0,151.5\ns1,303\ns2,454.5\n")
    assert "finding: Errors grow with the length by -9.9 mm/m" in out


def refuse_constant(constant: str) -> None:
    raise AssertionError(constant)


def test_json_is_for_programs(sol: Words, tmp_path: Path) -> None:
    status, out, _ = sol("--json", "-o", tmp_path / "result.json", known="s1,300\n")
    assert status == 0
    printed = json.loads(out, parse_constant=refuse_constant)
    assert printed == json.loads((tmp_path / "result.json").read_text())
    assert printed["format"] == "sheetoflight.verification"
    assert printed["summary"]["spread_mm"] is None
    (segment,) = printed["segments"]
    assert segment["known_mm"] == 300.0
    assert segment["error_mm"] == pytest.approx(0.0, abs=1e-6)
    assert segment["decision"] is None
    assert [one["segment"] for one in printed["not_judged"]] == ["s0", "s2"]
    assert sol("--json", known="s1,300\n")[1] == out


def test_with_several_lasers_one_is_named(sol: Words, tmp_path: Path) -> None:
    one = calibrated()
    other = LightPlane(RIG.light_plane.normal * [1, -1, 1], 1.1 * one.light_plane.distance_mm, "b")
    replace(one, light_planes=(one.light_plane, other)).save(tmp_path / "calibration.json")
    status, out, error = sol()
    assert (status, out) == (2, "")
    assert "laser" in error
    assert sol("--laser", "laser")[0] == 0
    status, _, error = sol("--laser", "c")
    assert (status, error.count("\n")) == (2, 1)
    assert "the laser 'c', which the calibration does not have" in error


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--known", "300", "--mpe-mm", "0"), "permissible"),
        (("--known", "300", "--mpe-mm", "-1"), "permissible"),
        (("--known", "nan"), "neither a number"),
        (("--known", "-3"), "known length is -3"),
        (("--known-std", "0.1"), "known_std_mm"),
    ],
    ids=str,
)
def test_bad_usage(sol: Words, words: tuple[str, ...], said: str) -> None:
    status, out, error = sol(*words)
    assert (status, out) == (2, "")
    assert said in error
    assert error.count("\n") == 1


def test_an_input_is_never_overwritten(sol: Words, tmp_path: Path) -> None:
    for name in ("calibration.json", "segments.csv", "known.csv"):
        for option in ("--output", "--page"):
            status, _, error = sol(option, tmp_path / name)
            assert status == 2
            assert "also an input" in error
    status, _, error = sol("-o", tmp_path / "both", "--page", tmp_path / "both")
    assert status == 2
    assert not (tmp_path / "both").exists()
