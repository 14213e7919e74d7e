"""``sol calibrate`` on photographs of boards with one thing wrong each.

A fault is either borne – camera and sheet come out within four standard uncertainties of the truth,
and what was left out is named – or refused with the picture or the setting, and what to do.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from sheetoflight.model.board import PlanarBoard
from tests.cli import board_photographs as scene
from tests.cli.board_photographs import (
    BOARDS,
    TRUTH,
    Calibrate,
    Pictures,
    Plate,
    calibrate,
    expect_truth,
    good,
    held,
    photograph,
    searched_once,
    searches,
)
from tests.cli.laser_pictures import Words, expect_error, sol
from tests.imaging.boards import drawing

__all__ = ["calibrate", "good", "searched_once", "searches", "sol"]

FEW, SOME = 2, 5
"""Pictures of folders that are refused, and of those in which each picture is another."""


def first(pictures: Mapping[str, np.ndarray], count: int = FEW) -> dict[str, np.ndarray]:
    return dict(list(pictures.items())[:count])


def taken(boards: Sequence[Plate], *more: Plate, **how: Any) -> dict[str, np.ndarray]:
    return {f"b{i}.png": photograph([b, *more], seed=i, **how) for i, b in enumerate(boards)}


def test_good_pictures_give_the_truth(good: Pictures, calibrate: Calibrate) -> None:
    found = expect_truth(calibrate(good))
    assert not any("b3: " in warning for warning in found["warnings"])


# --- one picture is wrong ---------------------------------------------------------------------


def shifted(plate: Plate, x: float) -> Plate:
    return replace(plate, at=plate.at + np.array([x, 0.0, 0.0]))


WRONG_PICTURES: dict[str, tuple[Callable[[], np.ndarray], str]] = {
    "half out of the picture": (
        lambda: photograph([shifted(BOARDS[3], 110.0)]),
        "board/b3: only",
    ),
    "blurred": (lambda: photograph([BOARDS[3]], blur=9.0), "board/b3: the picture is blurred"),
    "two boards": (
        lambda: photograph([held(10, -5, 3, 1000, 150, 130), held(0, 10, -3, 1000, 450, 330)]),
        "board/b3: two boards are in the picture",
    ),
    "no board": (lambda: photograph([]), "board/b3: no chessboard of 8 × 6 inner corners found"),
    "another board": (
        lambda: photograph([replace(BOARDS[3], columns=7, rows=5)]),
        "board/b3: found a board of 7 × 5 corners",
    ),
}


@pytest.mark.parametrize("fault", WRONG_PICTURES)
def test_one_wrong_picture_is_named_and_left_out(
    fault: str, good: Pictures, calibrate: Calibrate
) -> None:
    picture, told = WRONG_PICTURES[fault]
    expect_truth(calibrate({**good, "b3.png": picture()}), told)


@pytest.mark.parametrize(
    ("columns", "rows", "said"), [(-1, 1, "mirrored"), (-1, -1, "turned upside down")]
)
def test_one_picture_put_in_reversed_is_named_and_left_out(
    good: dict[str, np.ndarray], calibrate: Calibrate, columns: int, rows: int, said: str
) -> None:
    reversed_one = {"b3.png": good["b3.png"][::rows, ::columns]}
    expect_truth(calibrate(good | reversed_one), f"view b3 of stage board (the picture is {said})")


def test_a_wrong_picture_of_those_without_line_is_named(
    good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    """In camera/ are boards as well where there is no other target."""
    turned = photograph([held(20, 0, 60, 430, 320, 240)], laser=False)
    blurred = photograph([BOARDS[3]], laser=False, blur=9.0)
    more = {"../camera/c0.png": turned, "../camera/c1.png": blurred}
    found = expect_truth(calibrate({**good, **more}), "camera/c1: the picture is blurred")
    assert not any("c0" in warning for warning in found["warnings"])


WRONG_FILES: dict[str, tuple[Callable[[np.ndarray], np.ndarray | bytes], tuple[str, ...]]] = {
    "empty": (lambda _: b"", ("b3.png is empty",)),
    "text": (lambda _: b"no picture", ("b3.png is damaged", "save it as PNG")),
    "cut short": (
        lambda p: scene.png(p)[:9000],
        ("b3.png is damaged: it is cut short",),
    ),
    "cropped": (lambda p: p[:400], ("b3.png has 640×400 pixels", "640×480", "remove it")),
    "reduced": (lambda p: cv2.resize(p, (320, 240)), ("b3.png has 320×240 pixels",)),
}


@pytest.mark.parametrize("fault", WRONG_FILES)
def test_a_file_that_is_no_picture_of_the_camera_is_named(
    fault: str, good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    damaged, said = WRONG_FILES[fault]
    pictures = {**first(good), "b3.png": damaged(good["b3.png"])}
    expect_error(calibrate(pictures), 2, *said)


def test_a_copied_picture_is_named(good: dict[str, np.ndarray], calibrate: Calibrate) -> None:
    expect_error(calibrate({**first(good), "copy.png": good["b1.png"]}), 2, "copy", "b1")


def test_other_files_beside_the_pictures_are_nothing(good: Pictures, calibrate: Calibrate) -> None:
    expect_truth(calibrate({**good, "notes.txt": b"tilt more", "Thumbs.db": b"\0"}))


# --- rig.toml is wrong ------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(7, 6), (9, 7)])
def test_wrong_columns_and_rows_are_told(
    size: tuple[int, int], good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    """9 × 7 is what a person gets who counts the squares."""
    result = calibrate(first(good), columns=size[0], rows=size[1])
    asked = f"[board] says {size[0]} × {size[1]}"
    expect_error(result, 3, "found a board of 8 × 6 corners", asked, "inner corners, not squares")


def test_columns_and_rows_may_be_exchanged(
    good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    """Which way round the board is called is a matter of its frame."""
    expect_truth(calibrate(first(good, SOME), columns=6, rows=8))


def test_a_wrong_pitch_scales_everything_and_cannot_be_seen(
    good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    """A larger board further away gives the same pictures: the camera and the sheet's direction
    are right, its distance is in the proportion of the pitches. Nothing can be told of it."""
    result = calibrate(first(good, SOME), pitch=25.0)
    told = expect_truth(result, laser_d=scene.DISTANCE * 25.0 / scene.PITCH)
    assert not any("pitch" in warning for warning in told["warnings"])


# --- all pictures are wrong -------------------------------------------------------------------


def test_all_blurred(calibrate: Calibrate) -> None:
    expect_error(
        calibrate(taken(BOARDS[:FEW], blur=9.0)), 3, "b0.png: the picture is blurred", "focus"
    )


def test_all_mirrored_chessboards_give_the_mirrored_rig(
    good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    """A mirrored chessboard is a chessboard. What comes out is the rig in the mirror, with which
    lengths in mirrored pictures are right."""
    expect_truth(
        calibrate({name: picture[:, ::-1] for name, picture in first(good, SOME).items()}),
        camera_u0=scene.WIDTH - 1.0 - scene.CENTRE[0],
        laser_nx=-scene.NORMAL[0],
    )


def test_all_mirrored_charuco_boards_are_refused(tmp_path: Path, sol: Words) -> None:
    board = PlanarBoard("charuco", 7, 5, (20.0, 20.0))
    folder = tmp_path / "rig" / "board"
    folder.mkdir(parents=True)
    (tmp_path / "rig" / "rig.toml").write_text(
        '[board]\nkind = "charuco"\ncolumns = 7\nrows = 5\npitch_mm = [20.0, 20.0]\n'
    )
    picture = drawing.draw(board, drawing.view(board, tilt=0.3))
    cv2.imwrite(str(folder / "b0.png"), picture[:, ::-1])
    expect_error(sol("calibrate", tmp_path / "rig"), 3, "b0.png", "mirror")


def test_two_boards_give_little_and_say_so(
    good: dict[str, np.ndarray], calibrate: Calibrate
) -> None:
    two = {name: good[name] for name in ("b0.png", "b1.png")}
    found = expect_truth(calibrate(two))
    assert found["std"]["camera.alpha"] > 1.0


def test_one_board_is_refused(good: dict[str, np.ndarray], calibrate: Calibrate) -> None:
    expect_error(calibrate({"b0.png": good["b0.png"]}), 3, "fewer than 2 boards", "take pictures")


UPRIGHT = [(450, 230, 190), (420, 400, 280), (470, 250, 300), (500, 300, 240)]


def test_boards_that_are_all_parallel_are_refused(calibrate: Calibrate) -> None:
    pictures = taken([held(0.0, 0.0, 0.0, *place) for place in UPRIGHT])
    expect_error(calibrate(pictures), 3, "focal length alpha")


# --- the line ---------------------------------------------------------------------------------


def behind(board: Plate, gap: float) -> Plate:
    """A table parallel to a board."""
    return Plate(board.turn, board.at + board.turn @ np.array([70.0, 50.0, gap]), 0, 0, 260.0)


def test_the_line_on_a_table_behind_each_board_does_not_count(calibrate: Calibrate) -> None:
    """A centimetre behind it: the line on the table goes on nearly as that on the board."""
    pictures = {
        f"b{i}.png": photograph([board, behind(board, 10.0)], seed=i)
        for i, board in enumerate(BOARDS[:SOME])
    }
    expect_truth(calibrate(pictures))


def test_the_line_on_one_table_behind_all_boards_does_not_count(calibrate: Calibrate) -> None:
    """The table stands still and its line is longer than those on the boards, and everywhere the
    same: the worst case, as all its points agree with each other."""
    table = Plate(scene.turned(20, 0), np.array([0.0, 0.0, 560.0]), 0, 0, 300.0)
    expect_truth(calibrate(taken(BOARDS[:SOME], table)))


def test_where_the_laser_was_off_in_some_pictures_they_are_named(
    good: Pictures, calibrate: Calibrate
) -> None:
    dark = {f"b{i}.png": photograph([BOARDS[i]], laser=False, seed=i) for i in (1, 4, 6)}
    expect_truth(calibrate({**good, **dark}), "b1, b4, b6 of stage board")


def test_where_the_laser_was_off_in_all_pictures_the_camera_is_calibrated(
    calibrate: Calibrate,
) -> None:
    status, out, error = calibrate(taken(BOARDS[:SOME], laser=False))
    found = json.loads(out)
    assert (status, found["light_planes"]) == (0, [])
    assert "right if the laser was off" in error
    for name in ("alpha", "beta", "u0", "v0"):
        off = found["camera"][name] - TRUTH[f"camera.{name}"]
        assert abs(off) < 4.0 * found["std"][f"camera.{name}"], name


def test_a_sheet_through_the_camera_is_refused(
    calibrate: Calibrate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its line is always at the same place in the picture, wherever the board is."""
    monkeypatch.setattr(scene, "NORMAL", np.array([1.0, 0.0, 0.0]))
    monkeypatch.setattr(scene, "DISTANCE", 0.0)
    expect_error(calibrate(taken(BOARDS[:SOME])), 3, "near the camera's centre")
