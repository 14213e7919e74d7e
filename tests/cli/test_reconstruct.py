"""``sol reconstruct`` against rendered bars and drawn planes whose place in space is known."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.io.clouds import read_cloud
from sheetoflight.io.pictures import write_picture
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.views import ViewOptions, rig_pictures
from tests.cli.laser_pictures import (
    CAMERA,
    HEIGHT,
    SHEET,
    Words,
    a_line,
    calibration,
    cut_short,
    dark,
    expect_error,
    good,
    lit,
    saved,
    sol,
)
from tests.imaging.stripe.test_rendered_bars import small_rig
from tests.known_lengths import calibrated

__all__ = ["good", "sol"]

LINE_HEADER = (
    "image,line,points,length_mm,rms_mm,straightness_mm,noise_straightness_mm,x,y,z,dx,dy,dz"
)


@pytest.fixture
def known(tmp_path: Path) -> Path:
    calibration().save(tmp_path / "c.json")
    return tmp_path / "c.json"


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def columns(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in rows])


# --- a rendered bar -------------------------------------------------------------------------------

BAR_MM = 150.0


@pytest.fixture(scope="module")
def bar(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """Its pictures, laser off and on, and its true ends in the camera frame, mm."""
    folder = tmp_path_factory.mktemp("bar")
    rig, options = small_rig(), ViewOptions(clutter=0, bar_width_mm=40.0)
    ends = np.zeros((2, 3))
    for picture in rig_pictures(rig, 0, 0, [BAR_MM], options, seed=5):
        write_picture(folder / f"{picture.name}.png", picture.image)
        ends = np.array(picture.truth["ends_xyz"])
    calibrated(rig.camera, rig.light_plane).save(folder / "c.json")
    return folder, ends


def test_a_rendered_bar_lies_between_its_true_ends(
    bar: tuple[Path, np.ndarray], tmp_path: Path, sol: Words
) -> None:
    """Of the bar's own line: each point on the straight line through the true ends to within
    what is stated of it, and none beyond an end by more than a pixel."""
    folder, (first, last) = bar
    cloud, table = tmp_path / "cloud.csv", tmp_path / "lines.csv"
    words = ("reconstruct", folder / "c.json", folder / "bar00_off.png", folder / "bar00_on.png")
    assert sol(*words, "-o", cloud, "--lines-csv", table)[0] == 0
    rows = rows_of(cloud)
    xyz, noise = columns(rows, "x", "y", "z"), columns(rows, "noise_mm")[:, 0]
    plane = small_rig().light_plane
    assert np.abs(xyz @ plane.normal - plane.distance_mm).max() < 1e-9

    along = (last - first) / np.linalg.norm(last - first)
    place = (xyz - first) @ along
    off = np.linalg.norm(xyz - first - place[:, None] * along, axis=1)
    on_bar = off < 1.0
    pixel_mm = first[2] / small_rig().camera.beta
    assert on_bar.sum() > 0.8 * BAR_MM / pixel_mm * abs(along[1])
    assert place[on_bar].min() > -pixel_mm
    assert place[on_bar].max() < BAR_MM + pixel_mm
    assert np.ptp(place[on_bar]) > BAR_MM - 10 * pixel_mm
    assert np.sqrt(np.mean((off[on_bar] / noise[on_bar]) ** 2)) < 2.0

    assert table.read_text(encoding="utf-8").splitlines()[0] == LINE_HEADER
    (line,) = [row for row in rows_of(table) if int(row["points"]) == on_bar.sum()]
    assert line["image"] == "bar00"
    direction, point = columns([line], "dx", "dy", "dz")[0], columns([line], "x", "y", "z")[0]
    assert abs(direction @ along) > 1.0 - 1e-5
    assert np.linalg.norm(np.cross(point - first, along)) < 0.1
    assert float(line["length_mm"]) == pytest.approx(np.ptp(place[on_bar]), abs=0.01)
    assert float(line["rms_mm"]) < float(line["straightness_mm"])
    ratio = float(line["straightness_mm"]) / float(line["noise_straightness_mm"])
    assert 0.5 < ratio < 2.0


def test_every_ending_holds_the_same_points_and_each_time_the_same_bytes(
    known: Path, good: Path, tmp_path: Path, sol: Words
) -> None:
    first, again = tmp_path / "a.ply", tmp_path / "b.ply"
    for path in (first, again):
        assert sol("reconstruct", known, good, "-o", path)[0] == 0
    assert first.read_bytes() == again.read_bytes()
    assert sol("reconstruct", known, good, "-o", tmp_path / "a.xyz")[0] == 0
    assert np.array_equal(read_cloud(first), np.loadtxt(tmp_path / "a.xyz")[:, :3])


def test_the_terminal_shows_twenty_lines_and_json_all(
    known: Path, tmp_path: Path, sol: Words
) -> None:
    np.save(tmp_path / "many.npy", np.stack([a_line(seed) for seed in range(22)]))
    words = ("reconstruct", known, tmp_path / "many.npy", "-o", tmp_path / "c.ply")
    status, out, error = sol(*words)
    assert (status, error) == (0, "")
    assert "many.npy[19]" in out
    assert "many.npy[20]" not in out
    assert "and 2 lines more" in out
    document = json.loads(sol(*words, "--json")[1])
    assert [line["image"] for line in document["lines"]] == [f"many.npy[{i}]" for i in range(22)]
    assert list(document["lines"][0]) == LINE_HEADER.split(",")
    assert document["points"] == sum(line["points"] for line in document["lines"])
    assert (document["pictures"], document["skipped"]) == (22, 0)


# --- an object that moves -------------------------------------------------------------------------

NORMAL = np.array([0.28, -0.6, 0.7491995728776144])
"""Of a tilted plane, unit length."""
THROUGH = np.array([0.0, 0.0, 700.0])
STEP = (0.5, 4.0, -1.5)


def drawn_frames(count: int) -> list[np.ndarray]:
    """The tilted plane as the camera sees it in the sheet of light, moved by STEP each time.

    Sheet and plane meet in a straight line, and so does its image: through two of its points,
    projected by hand.
    """
    direction = np.cross(SHEET.normal, NORMAL)
    frames = []
    for k in range(count):
        middle = THROUGH + k * np.array(STEP)
        rows = np.stack([SHEET.normal, NORMAL, direction])
        point = np.linalg.solve(rows, np.array([SHEET.distance_mm, *(rows[1:] @ middle)]))
        seen = [point - 60.0 * direction, point + 60.0 * direction]
        uv = [(CAMERA.matrix @ (xyz / xyz[2]))[:2] for xyz in seen]
        frames.append(lit(uv[0], uv[1], seed=k))
    return frames


def off_the_plane(xyz: np.ndarray) -> float:
    """Root mean square distance from where the plane was in the first picture, mm."""
    return float(np.sqrt(np.mean(((xyz - THROUGH) @ NORMAL) ** 2)))


def test_a_moved_plane_comes_out_plane_whatever_frame_is_lost(
    known: Path, tmp_path: Path, sol: Words
) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    paths = [saved(folder / f"f_{8 + k}.png", one) for k, one in enumerate(drawn_frames(5))]
    cut_short(paths[2])
    words = ("reconstruct", known, folder, "-o", tmp_path / "c.ply")

    def cloud(*step: float) -> np.ndarray:
        options = ("--step-mm", *step) if step else ()
        status, _, error = sol(*words, *options)
        assert (status, error.count("\n")) == (0, 1)
        return read_cloud(tmp_path / "c.ply")

    assert off_the_plane(cloud(*STEP)) < 0.1
    assert off_the_plane(cloud()) > 3.0
    assert off_the_plane(cloud(*(-part for part in STEP))) > 6.0
    assert np.array_equal(cloud(0.0, 0.0, 0.0), cloud())


def test_lines_move_with_their_points(known: Path, tmp_path: Path, sol: Words) -> None:
    np.save(tmp_path / "f.npy", np.stack(drawn_frames(4)))
    words = ("reconstruct", known, tmp_path / "f.npy", "-o", tmp_path / "c.csv", "--step-mm", *STEP)
    assert sol(*words, "--lines-csv", tmp_path / "l.csv")[0] == 0
    lines = rows_of(tmp_path / "l.csv")
    assert len(lines) == 4
    for line in lines:
        rows = [row for row in rows_of(tmp_path / "c.csv") if row["picture"] == line["image"]]
        assert off_the_plane(columns([line], "x", "y", "z")) < 0.1
        off = columns(rows, "x", "y", "z") - columns([line], "x", "y", "z")
        across = np.cross(off, columns([line], "dx", "dy", "dz"))
        rms = np.sqrt(np.mean(np.sum(across**2, axis=1)))
        assert rms == pytest.approx(float(line["rms_mm"]), rel=1e-6)


def test_pictures_in_a_shells_order_are_warned_of_where_the_object_moves(
    known: Path, tmp_path: Path, sol: Words
) -> None:
    paths = [saved(tmp_path / f"f_{9 + k}.png", one) for k, one in enumerate(drawn_frames(2))]
    words = ("reconstruct", known, *paths[::-1], "-o", tmp_path / "c.ply")
    status, _, error = sol(*words, "--step-mm", *STEP)
    assert status == 0
    assert error.startswith("warning: the object is taken to move in the order")
    assert sol(*words)[2] == ""


# --- bad usage and bad input ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "c.pcd"), "no point clouds are written as '.pcd' – end the name in .ply"),
        (("-o", "c"), "the name has no ending"),
        (("-o", "no/c.ply"), "make the folder first"),
        (("-o", "c.ply", "--lines-csv", "no/l.csv"), "make the folder first"),
        (("-o", "c.csv", "--lines-csv", "./c.csv"), "both to be written to c.csv"),
        (("-o", "c.ply", "--lines-csv", "good.png"), "good.png is also an input"),
        (("-o", "c.ply", "--lines-csv", "c.json"), "c.json is also an input"),
        (("-o", "c.ply", "--laser", "green"), "no laser 'green'"),
        (("-o", "c.ply", "--step-mm", "0", "nan", "0"), "three finite numbers"),
        (("-o", "c.ply", "--step-mm", "1", "2"), "--step-mm"),
        (("-o", "c.ply", "--detector", "magic"), "'magic' is not known"),
        (("-o", "c.ply", "--off", "missing.png"), "missing.png does not exist"),
        (("-o", "c.ply", "--mask", "missing.png"), "missing.png does not exist"),
        ((), "--output"),
    ],
    ids=" ".join,
)
def test_bad_usage(
    words: tuple[str, ...],
    said: str,
    known: Path,
    good: Path,
    tmp_path: Path,
    sol: Words,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    before = {path.name: path.read_bytes() for path in (known, good)}
    expect_error(sol("reconstruct", "c.json", "good.png", *words), 2, said)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_output_that_cannot_be_is_refused_before_the_work(
    known: Path, good: Path, tmp_path: Path, sol: Words, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(*_: object) -> None:
        raise AssertionError("the pictures were looked at")

    monkeypatch.setattr("sheetoflight.cli.reconstruct.find_points", work)
    expect_error(sol("reconstruct", known, good, "-o", tmp_path / "no" / "c.ply"), 2, "c.ply")


def test_a_calibration_of_another_picture_size(good: Path, tmp_path: Path, sol: Words) -> None:
    camera = replace(CAMERA, image_size=(640, 480))
    calibrated(camera, SHEET).save(tmp_path / "c.json")
    words = ("reconstruct", tmp_path / "c.json", good, "-o", tmp_path / "c.ply")
    expect_error(sol(*words), 2, f"good has 200×{HEIGHT} pixels, the calibrated camera 640×480")
    assert not (tmp_path / "c.ply").exists()


def test_one_of_two_lasers_must_be_named(good: Path, tmp_path: Path, sol: Words) -> None:
    other = LightPlane(np.array([-0.6, 0.0, 0.8]), 560.0, "other")
    replace(calibration(), light_planes=(SHEET, other)).save(tmp_path / "two.json")
    words = ("reconstruct", tmp_path / "two.json", good, "-o", tmp_path / "c.ply")
    expect_error(sol(*words), 2, "laser and other", "--laser")
    assert not (tmp_path / "c.ply").exists()
    for plane in (SHEET, other):
        assert sol(*words, "--laser", plane.name)[0] == 0
        off = read_cloud(tmp_path / "c.ply") @ plane.normal - plane.distance_mm
        assert np.abs(off).max() < 1e-9


def test_no_line_in_any_picture_is_no_result(known: Path, tmp_path: Path, sol: Words) -> None:
    paths = [saved(tmp_path / f"{k}.png", dark()) for k in range(2)]
    words = ("reconstruct", known, *paths, "-o", tmp_path / "c.ply")
    expect_error(sol(*words, "--lines-csv", tmp_path / "l.csv"), 3, "no laser line in 2 pictures")
    assert sorted(tmp_path.iterdir()) == [*paths, known]


def test_strict_fails_after_the_rest_is_written(
    known: Path, good: Path, tmp_path: Path, sol: Words
) -> None:
    bad = cut_short(saved(tmp_path / "bad.png", a_line()))
    words = ("reconstruct", known, good, bad, "-o", tmp_path / "c.ply")
    status, out, error = sol(*words)
    assert (status, error.count("\n")) == (0, 1)
    assert "points of 1 picture, 1 skipped written to" in out
    whole = (tmp_path / "c.ply").read_bytes()
    (tmp_path / "c.ply").unlink()
    status, _, error = sol(*words, "--strict")
    assert status == 2
    assert (tmp_path / "c.ply").read_bytes() == whole
    assert error.splitlines()[-1].startswith("error: 1 of 2 pictures could not be used – ")
