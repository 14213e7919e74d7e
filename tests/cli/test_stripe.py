"""``sol stripe`` as three people meet it: in a hurry, with a real rig, and reading first."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
import tifffile

from tests.cli.laser_pictures import (
    HEIGHT,
    Told,
    Words,
    a_line,
    claiming,
    cut_short,
    dark,
    expect_error,
    good,
    saved,
    sol,
)

__all__ = ["good", "sol"]

HEADER = "image,u,v,std_px,width_px,peak"


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


# --- results --------------------------------------------------------------------------------------


def test_the_drawn_line_is_found_where_it_was_drawn(good: Path, sol: Words) -> None:
    status, out, error = sol("stripe", good)
    assert (status, error) == (0, "")
    assert out.splitlines()[0] == HEADER
    rows = rows_of(out)
    assert {row["image"] for row in rows} == {"good"}
    u, v, std = (np.array([float(row[name]) for row in rows]) for name in ("u", "v", "std_px"))
    across = ((u - 60.0) * 159.0 - v * 45.0) / np.hypot(159.0, 45.0)
    assert len(rows) > 0.9 * HEIGHT
    assert np.sqrt(np.mean((across / std) ** 2)) < 1.5
    assert np.ptp(v) > 0.9 * HEIGHT


def test_a_file_holds_what_would_be_printed_and_the_same_each_time(
    good: Path, tmp_path: Path, sol: Words
) -> None:
    _, printed, _ = sol("stripe", good, "--all-columns")
    for name in ("one.csv", "two.csv"):
        assert sol("stripe", good, "-o", tmp_path / name, "--all-columns")[0] == 0
        assert (tmp_path / name).read_text(encoding="utf-8") == printed
    assert printed.splitlines()[0] == f"{HEADER},line,across_u,across_v"


def test_a_scan_gives_one_centre_in_each_row(good: Path, sol: Words) -> None:
    status, out, _ = sol("stripe", good, "--scan", "rows", "--detector", "centroid")
    assert status == 0
    u, v = (np.array([float(row[name]) for row in rows_of(out)]) for name in ("u", "v"))
    assert np.array_equal(v, np.unique(np.rint(v)))
    assert len(v) > 0.9 * HEIGHT
    assert np.abs(u - 60.0 - 45.0 / 159.0 * v).max() < 0.3


def test_frames_come_by_the_numbers_in_their_names(tmp_path: Path, sol: Words) -> None:
    (tmp_path / "scan").mkdir()
    for number in (10, 9, 2, 1):
        saved(tmp_path / "scan" / f"frame_{number}.png", a_line(number))
    _, out, _ = sol("stripe", tmp_path / "scan")
    names = list(dict.fromkeys(row["image"] for row in rows_of(out)))
    assert names == ["frame_1", "frame_2", "frame_9", "frame_10"]


def test_two_pictures_of_one_name_are_told_apart_by_their_folders(
    tmp_path: Path, sol: Words
) -> None:
    paths = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        paths.append(saved(tmp_path / folder / "x.png", a_line()))
    _, out, _ = sol("stripe", *paths)
    assert {row["image"] for row in rows_of(out)} == {str(path.with_suffix("")) for path in paths}
    twin = saved(tmp_path / "a" / "x.tif", a_line())
    expect_error(sol("stripe", twin.parent), 2, "x.png and x.tif")


def test_the_table_says_what_was_found_and_letters_stay_letters(tmp_path: Path, sol: Words) -> None:
    picture = saved(tmp_path / "[b]x[b].png", a_line())
    status, out, _ = sol("stripe", picture, "-o", tmp_path / "s.csv")
    assert status == 0
    assert "[b]x[b]" in out
    assert "gaussian: " in out
    assert out.splitlines()[-1].endswith(f"centres of 1 picture written to {tmp_path / 's.csv'}")


def test_json_sums_every_picture_up(good: Path, tmp_path: Path, sol: Words) -> None:
    bad = cut_short(saved(tmp_path / "bad.png", a_line()))
    status, out, error = sol("stripe", good, bad, "--json")
    assert status == 0
    document = json.loads(out)
    (one,), (skipped,) = document["pictures"], document["skipped"]
    assert (one["image"], one["lines"]) == ("good", 1)
    assert one["width_px"] == pytest.approx(1.6, abs=0.1)
    assert one["peak"] == pytest.approx(150.0, abs=5.0)
    assert skipped["image"] == "bad"
    assert error == f"warning: {skipped['why']} (skipped)\n"


# --- pictures that cannot be used -----------------------------------------------------------------


def npy(path: Path, array: np.ndarray) -> Path:
    np.save(path, array)
    return path


def text(path: Path) -> Path:
    path.write_text("u,v\n")
    return path


def empty_folder(path: Path) -> Path:
    path.mkdir()
    return path


def giant_npy(path: Path) -> Path:
    with path.open("wb") as file:
        header = {"descr": "|u1", "fortran_order": False, "shape": (60_000, 60_000)}
        np.lib.format.write_array_header_1_0(file, header)
    return path


def deflated(path: Path) -> Path:
    """A TIFF as OpenCV packs it, its strips damaged where no checksum of a header would tell."""
    ok, data = cv2.imencode(".tif", a_line(), (cv2.IMWRITE_TIFF_COMPRESSION, 32946))
    assert ok
    content = bytearray(data.tobytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(byte ^ 0xA5 for byte in content[middle : middle + 40])
    path.write_bytes(content)
    return path


BAD: dict[str, tuple[Callable[[Path], Path], str, int, str]] = {
    "black": (lambda p: saved(p, 0 * a_line()), "a.png", 3, "no laser line in 1 picture "),
    "white": (lambda p: saved(p, 0 * a_line() + 255), "a.png", 3, "no laser line in 1 picture "),
    "dark": (lambda p: saved(p, dark()), "a.png", 3, "--off"),
    "one pixel": (lambda p: saved(p, a_line()[:1, :1]), "a.png", 3, "no laser line"),
    "one axis": (lambda p: npy(p, a_line().ravel()), "a.npy", 2, "has shape"),
    "bool": (lambda p: npy(p, a_line() > 99), "a.npy", 2, "holds bool samples"),
    "float": (lambda p: npy(p, a_line() / 9.0), "a.npy", 2, "holds float64 samples"),
    "cut png": (lambda p: cut_short(saved(p, a_line())), "a.png", 2, "is cut short"),
    "cut jpeg": (lambda p: cut_short(saved(p, a_line())), "a.jpg", 2, "its end is missing"),
    "cut tiff": (lambda p: cut_short(saved(p, a_line())), "a.tif", 2, "is damaged"),
    "cut npy": (lambda p: cut_short(npy(p, a_line())), "a.npy", 2, "is cut short"),
    "damaged tiff": (deflated, "a.tif", 2, "is damaged"),
    "text": (text, "a.png", 2, "is damaged or in a format that cannot be read"),
    "gigantic png": (lambda p: claiming(p, 60_000, 60_000), "a.png", 2, "more than 200000000"),
    "gigantic npy": (giant_npy, "a.npy", 2, "more than 200000000"),
    "missing": (lambda p: p, "a.png", 2, "does not exist"),
    "name too long": (lambda p: p.with_name("a" * 300), "a.png", 2, "cannot be read"),
    "empty folder": (empty_folder, "a", 2, "holds no picture, stack or video"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_named_in_one_line_and_nothing_written(
    case: str, tmp_path: Path, sol: Words
) -> None:
    make, name, status, said = BAD[case]
    path = make(tmp_path / name)
    expect_error(sol("stripe", path), status, said)
    expect_error(sol("stripe", path, "-o", tmp_path / "s.csv"), status, said)
    expect_error(sol("stripe", path, "--json"), status, said)
    assert [left.name for left in tmp_path.iterdir()] in ([], [name])


def test_a_fourth_channel_is_transparency(tmp_path: Path, sol: Words) -> None:
    opaque = npy(tmp_path / "three.npy", np.dstack([a_line()] * 3))
    clear = npy(tmp_path / "four.npy", np.dstack([*[a_line()] * 3, 0 * a_line()]))
    _, with_three, _ = sol("stripe", opaque)
    _, with_four, _ = sol("stripe", clear)
    assert with_four == with_three.replace("three.npy", "four.npy")
    assert len(rows_of(with_four)) > 0.9 * HEIGHT


def test_a_stack_that_ends_in_a_frame_gives_the_whole_ones(tmp_path: Path, sol: Words) -> None:
    path = npy(tmp_path / "a.npy", np.stack([a_line(seed) for seed in range(5)]))
    status, out, error = sol("stripe", cut_short(path))
    assert status == 0
    assert {row["image"] for row in rows_of(out)} == {"a.npy[0]", "a.npy[1]"}
    assert error.count("\n") == 1
    assert "3 of its 5 frames are missing" in error


def test_damage_is_counted_and_strict_fails_after_the_rest_is_written(
    good: Path, tmp_path: Path, sol: Words
) -> None:
    bad = [cut_short(saved(tmp_path / f"bad{i}.png", a_line())) for i in range(3)]
    output = tmp_path / "s.csv"
    status, out, error = sol("stripe", bad[0], good, *bad[1:], "-o", output)
    assert status == 0
    assert "of 1 picture, 3 skipped written to" in out
    assert [line.split(" is ")[0] for line in error.splitlines()] == [f"warning: {b}" for b in bad]
    whole = output.read_bytes()
    output.unlink()
    status, _, error = sol("stripe", *bad, good, "-o", output, "--strict")
    assert status == 2
    assert output.read_bytes() == whole
    last = error.splitlines()[-1]
    assert last.startswith("error: 3 of 4 pictures could not be used – ")


def test_many_damaged_pictures_do_not_flood_the_terminal(
    good: Path, tmp_path: Path, sol: Words
) -> None:
    bad = [text(tmp_path / f"bad{i:02}.png") for i in range(14)]
    status, out, error = sol("stripe", good, *bad, "--json")
    assert status == 0
    assert len(json.loads(out)["skipped"]) == 14
    assert error.count("(skipped)") == 10
    assert error.count("counted, not named") == 1
    expect_error(sol("stripe", *bad), 2, "none of 14 pictures could be used", "bad00.png")


# --- bad usage ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--region", "180", "0", "40", "160"), "does not lie in the picture of 200×160"),
        (("--region", "-5", "0", "40", "160"), "does not lie in the picture"),
        (("--region", "3", "4"), "--region"),
        (("--mask", "small.png"), "(100, 120), the picture (160, 200)"),
        (("--mask", "black.png"), "black.png is black"),
        (("--mask", "missing.png"), "missing.png does not exist"),
        (("--off", "small.png"), "(160, 200), the one with it off (100, 120)"),
        (("--off", "deep.png"), "uint8, the one with it off uint16"),
        (("--off", "colour.png"), "(160, 200), the one with it off (160, 200, 3)"),
        (("--detector", "magic"), "'magic' is not known – choose auto | thin | "),
        (("--scan", "diagonals"), "diagonals"),
        (("--scan", "rows", "--detector", "thin"), "--scan does not work with the detector 'thin'"),
        (("--lines", "longest"), "longest"),
        (("--speckle", "2", "660", "8", "3.45"), "contrast is 2.0"),
        (("--speckle", "1", "660"), "--speckle"),
        (("--no-strict",), "--no-strict"),
    ],
    ids=" ".join,
)
def test_bad_usage(
    words: tuple[str, ...],
    said: str,
    good: Path,
    tmp_path: Path,
    sol: Words,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    saved(tmp_path / "small.png", a_line()[:100, :120])
    saved(tmp_path / "black.png", 0 * a_line())
    saved(tmp_path / "deep.png", a_line().astype(np.uint16) * 256)
    saved(tmp_path / "colour.png", np.dstack([dark()] * 3))
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    expect_error(sol("stripe", good, *words), 2, said)
    expect_error(sol("stripe", good, "-o", "s.csv", *words), 2, said)
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_read_is_never_overwritten(good: Path, tmp_path: Path, sol: Words) -> None:
    """Neither by its own name, nor by another, nor as one of a folder's."""
    mask = saved(tmp_path / "mask.png", 0 * a_line() + 255)
    link = tmp_path / "link.csv"
    link.symlink_to(good)
    before = {path: path.read_bytes() for path in (good, mask)}
    for output in (good, link, mask):
        expect_error(sol("stripe", good, "--mask", mask, "-o", output), 2, "is also an input")
    expect_error(sol("stripe", tmp_path, "-o", good), 2, "is also an input")
    assert {path: path.read_bytes() for path in before} == before


def test_outputs_that_cannot_be(good: Path, tmp_path: Path, sol: Words) -> None:
    expect_error(sol("stripe", good, "-o", tmp_path / "no" / "s.csv"), 2, "make the folder first")
    expect_error(sol("stripe", good, "-o", tmp_path), 2, "folder")
    expect_error(sol("stripe", good, "-o", tmp_path / ("s" * 300)), 2, "choose a shorter name")
    assert list(tmp_path.iterdir()) == [good]


@contextmanager
def as_nobody() -> Iterator[None]:
    """Without the rights of the superuser, who may enter every folder."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_folders_without_permission(sol: Words) -> None:
    with TemporaryDirectory() as name:  # a test's own folder lies in one that is closed
        folder, closed = Path(name), Path(name) / "closed"
        folder.chmod(0o755)
        good = saved(folder / "good.png", a_line())
        closed.mkdir()
        saved(closed / "a.png", a_line())
        closed.chmod(0)
        told: list[Told] = []
        with as_nobody():
            told += [sol("stripe", closed), sol("stripe", closed / "a.png")]
            told += [sol("stripe", good, "-o", closed / "s.csv")]
            assert sol("stripe", good)[0] == 0
        closed.chmod(0o700)
    for result in told:
        expect_error(result, 2, "closed", "Permission denied")


def test_a_name_that_is_no_text_has_no_place_in_a_table(tmp_path: Path, sol: Words) -> None:
    picture = tmp_path / os.fsdecode(b"\xff.png")
    try:
        picture.write_bytes(saved(tmp_path / "a.png", a_line()).read_bytes())
    except (OSError, UnicodeError):
        pytest.skip("this file system holds no such names")
    expect_error(sol("stripe", picture), 2, "characters that are no text")
    expect_error(sol("stripe", picture, "-o", tmp_path / "s.csv"), 2, "characters that are no text")
    status, out, _ = sol("stripe", picture, "--json")
    assert status == 0
    assert json.loads(out)["pictures"][0]["image"] == r"\udcff"


def test_an_interrupt_leaves_nothing_half_written(tmp_path: Path) -> None:
    """Ctrl-C in mid-stream, as a terminal sends it: to the command and all its processes."""
    folder = tmp_path / "out"
    folder.mkdir()
    tifffile.imwrite(tmp_path / "a.tif", np.stack([a_line(0)] * 1500), photometric="minisblack")
    # a shell starts background jobs with interrupts ignored, and children inherit that
    start = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from sheetoflight.cli.main import run; run()"
    )
    words = ["stripe", str(tmp_path / "a.tif"), "-o", str(folder / "s.csv")]
    command = subprocess.Popen(
        [sys.executable, "-c", start, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    try:
        deadline = time.monotonic() + 60
        while not any(path.stat().st_size for path in folder.iterdir()):
            assert command.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
        os.killpg(command.pid, signal.SIGINT)
        out, error = command.communicate(timeout=60)
    finally:
        if command.poll() is None:
            os.killpg(command.pid, signal.SIGKILL)
            command.communicate()
    assert (command.returncode, out) == (130, "")
    assert error == "error: interrupted – nothing half-written was left\n"
    assert list(folder.iterdir()) == []


def test_rows_go_to_standard_output_whatever_shows_the_progress(good: Path) -> None:
    """With standard error on a terminal, where the bar is drawn."""
    terminal, end = os.openpty()
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "sheetoflight.cli.main", "stripe", str(good)],
            stdout=subprocess.PIPE,
            stderr=end,
            text=True,
            check=False,
            timeout=60,
            env={**os.environ, "TERM": "xterm"},  # a dumb terminal shows no bar
        )
        shown = os.read(terminal, 100_000).decode()
    finally:
        os.close(terminal)
        os.close(end)
    assert ended.returncode == 0
    assert "find the line" in shown
    assert HEADER not in shown
    assert ended.stdout.splitlines()[0] == HEADER
    assert len(rows_of(ended.stdout)) > 0.9 * HEIGHT


# --- help -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["stripe", "reconstruct"])
def test_help_offers_no_negatives_of_flags(command: str, sol: Words) -> None:
    status, out, _ = sol(command, "--help")
    assert status == 0
    assert "--strict" in out
    assert "--no-" not in out
