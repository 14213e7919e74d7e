"""Stage crossing of a rig folder: drawn pictures in, spots in points.csv out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.io.points_csv import read_points
from sheetoflight.workflow.rig_folder import detect, load_rig
from tests.imaging.crossings import Crossing, view

PAIR = Crossing(view())
SINGLE = Crossing(view(roll=0.2), spot_mm=290.0, slant=0.5)
RIG = """
[target]
kind = "collinear"
markers_mm = [0.0, 200.0, 400.0]
marker = "quadrant"
marker_size_mm = 24.0

[camera]
distortion = "none"
skew = false
"""


def write(path: Path, picture: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A pair, a single picture with the laser on, and one with the laser forgotten."""
    (tmp_path / "rig.toml").write_text(RIG)
    write(tmp_path / "camera" / "c0.png", replace(PAIR, matrix=view(roll=0.4)).drawn(False))
    off, on = PAIR.pair()
    write(tmp_path / "crossing" / "a_off.png", off)
    write(tmp_path / "crossing" / "a_on.png", on)
    write(tmp_path / "crossing" / "b.png", SINGLE.drawn())
    write(tmp_path / "crossing" / "dark.png", SINGLE.drawn(False, seed=3))
    return tmp_path


def test_spots_are_found_and_written(folder: Path) -> None:
    detection = detect(folder)
    views = detection.rig.observations.crossing
    assert views.names == ("a", "b")
    for crossing, uv, std in zip((PAIR, SINGLE), views.uv, np.array(views.std), strict=True):
        assert np.linalg.norm(uv[3] - crossing.spot) < 4 * np.sqrt(2) * std[3] + 0.02
        assert 0.001 < std[3] < 0.05
    (missed,) = detection.missed
    assert (missed.stage, missed.view) == ("crossing", "dark")
    assert missed.reason.startswith("no laser line on the target's strip")
    rows = (folder / "points.csv").read_text().splitlines()
    assert sum(row.startswith("a,crossing,laser,") for row in rows) == 1
    again = read_points(folder / "points.csv", detection.rig.target).crossing
    assert np.array_equal(again.uv, views.uv)
    assert np.array_equal(np.array(again.std), np.array(views.std))


def test_pictures_are_searched_without_points(folder: Path) -> None:
    expected = detect(folder).rig.observations.crossing
    (folder / "points.csv").unlink()
    assert np.array_equal(load_rig(folder).observations.crossing.uv, expected.uv)


def test_each_of_two_lasers_has_a_folder_of_crossing_pictures(folder: Path) -> None:
    with (folder / "rig.toml").open("a") as file:
        file.write('\n[[laser]]\nname = "left"\n\n[[laser]]\nname = "right"\n')
    with pytest.raises(InputError, match=r"crossing holds no folder left/, but the rig has 2"):
        detect(folder)
    for name, files in {"left": ("a_off", "a_on"), "right": ("b", "dark")}.items():
        (folder / "crossing" / name).mkdir()
        for file in files:
            (folder / "crossing" / f"{file}.png").rename(folder / "crossing" / name / f"{file}.png")
    views = detect(folder).rig.observations.crossing
    assert views.names == ("left/a", "right/b")
    assert views.seen[:, 3:].tolist() == [[True, False], [False, True]]


def test_no_spot_in_any_picture_is_an_error(folder: Path) -> None:
    for name in ("a_off", "a_on", "b"):
        (folder / "crossing" / f"{name}.png").unlink()
    with pytest.raises(
        UntrustworthyError,
        match=r"crossing stage: the laser's spot .* in none of 1 pictures; dark.png: no laser line",
    ):
        detect(folder)
    assert not (folder / "points.csv").exists()


def test_a_target_that_is_not_seen_is_told(folder: Path) -> None:
    write(folder / "crossing" / "empty.png", np.full(PAIR.shape, 60, np.uint8))
    missed = {one.view: one.reason for one in detect(folder).missed}
    assert "no marker found" in missed["empty"]


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.full((64, 64), 60, np.uint8), r"crossing/z.png has 64×64 pixels, the rig's"),
        (np.zeros((*PAIR.shape, 3), np.uint8), r"a_on.png: the picture with the laser on has sh"),
    ],
    ids=["another size", "a pair of grey and colour"],
)
def test_a_picture_that_cannot_be_used_is_named(
    folder: Path, picture: np.ndarray, message: str
) -> None:
    write(folder / "crossing" / ("z.png" if picture.ndim == 2 else "a_on.png"), picture)
    with pytest.raises(InputError, match=message):
        detect(folder)


def test_views_in_points_are_kept_where_there_are_no_pictures(folder: Path) -> None:
    found = detect(folder).rig.observations.crossing
    for path in (folder / "crossing").iterdir():
        path.unlink()
    kept = detect(folder).rig.observations.crossing
    assert kept.names == found.names
    assert np.array_equal(kept.uv, found.uv)
