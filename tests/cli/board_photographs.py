"""Colour photographs of chessboards under a red sheet of light, drawn ray by ray: they share no
code with the renderer, and anything may be laid into them. What is calibrated from them is compared
with the truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from sheetoflight.io.pictures import PictureFile
from sheetoflight.model.board import Board
from sheetoflight.workflow import boards
from sheetoflight.workflow.boards import BoardPicture, searched_board
from tests.cli.laser_pictures import Words

Array = np.ndarray
Pictures = Mapping[str, np.ndarray | bytes]
Calibrate = Callable[..., tuple[int, str, str]]

WIDTH, HEIGHT = 640, 480
FOCAL, CENTRE = 900.0, (326.0, 233.0)
MATRIX = np.array([[FOCAL, 0.0, CENTRE[0]], [0.0, FOCAL, CENTRE[1]], [0.0, 0.0, 1.0]])
NORMAL, DISTANCE = np.array([0.8, 0.0, 0.6]), 270.0
"""The sheet of light, n · X = d, mm."""

COLUMNS, ROWS, PITCH = 8, 6, 20.0
FINE = 3
"""Samples along each side of a pixel."""

AMBIENT, RED, NOISE = 150.0, 140.0, 1.0
BLACK, WHITE, WALL = 0.1, 1.0, 0.3
THICK_MM = 0.9


@dataclass(frozen=True)
class Plate:
    """A flat thing in space: a chessboard of so many inner corners, or plain where it has none.

    Its points are ``turn @ (x, y, 0) + at``, (0, 0) being the first corner of the board, or the
    middle of a plain one; `margin` mm of it lie beyond the outer squares, or about its middle.
    """

    turn: Array
    at: Array
    columns: int = COLUMNS
    rows: int = ROWS
    margin: float = 10.0

    def reflectance(self, x: Array, y: Array) -> Array:
        """At places on it, mm; NaN beside it."""
        reach_x, reach_y = PITCH * self.columns, PITCH * self.rows
        low = -PITCH - self.margin if self.columns else -self.margin
        inside = (x > low) & (x < reach_x + self.margin)
        inside &= (y > low) & (y < reach_y + self.margin)
        column, row = np.floor(x / PITCH), np.floor(y / PITCH)
        printed = (column >= -1) & (column < self.columns) & (row >= -1) & (row < self.rows)
        black = printed & ((column + row) % 2 == 0) & (self.columns > 0)
        return np.where(inside, np.where(black, BLACK, WHITE), np.nan)


def turned(tilt_x: float, tilt_y: float, roll: float = 0.0) -> Array:
    """A rotation matrix by degrees about x, then y, then the line of sight."""
    x, y, z = (
        cv2.Rodrigues(np.radians(angle) * axis)[0]
        for angle, axis in zip((tilt_x, tilt_y, roll), np.eye(3), strict=True)
    )
    return np.asarray(z @ y @ x)


def held(tilt_x: float, tilt_y: float, roll: float, depth: float, u: float, v: float) -> Plate:
    """A chessboard whose middle is seen at (u, v) px."""
    turn = turned(tilt_x, tilt_y, roll)
    middle = 0.5 * PITCH * np.array([COLUMNS - 1, ROWS - 1, 0.0])
    seen = depth * np.array([(u - CENTRE[0]) / FOCAL, (v - CENTRE[1]) / FOCAL, 1.0])
    return Plate(turn, seen - turn @ middle)


BOARDS = (
    held(25, 10, 5, 460, 230, 190),
    held(-30, 5, -10, 430, 420, 290),
    held(5, 35, 15, 460, 240, 300),
    held(10, -35, -5, 440, 400, 180),
    held(-25, -25, 12, 450, 250, 240),
    held(30, 25, -12, 440, 390, 240),
    held(-20, 30, 8, 420, 320, 180),
    held(20, -28, -10, 430, 320, 300),
)
"""The boards of a good rig folder."""


def photograph(
    plates: Sequence[Plate], laser: bool = True, seed: int = 0, blur: float = 0.7
) -> Array:
    """What the camera sees of plates before a wall, `blur` px out of focus: BGR."""
    x = (((np.arange(WIDTH * FINE) + 0.5) / FINE - 0.5) - CENTRE[0]) / FOCAL
    y = ((((np.arange(HEIGHT * FINE) + 0.5) / FINE - 0.5) - CENTRE[1]) / FOCAL)[:, None]
    shape = HEIGHT * FINE, WIDTH * FINE
    depth, reflectance = np.full(shape, 1200.0), np.full(shape, WALL)
    for plate in plates:
        normal = plate.turn[:, 2]
        z = normal @ plate.at / (normal[0] * x + normal[1] * y + normal[2])
        a, b = (
            z * (axis[0] * x + axis[1] * y + axis[2]) - axis @ plate.at for axis in plate.turn.T[:2]
        )
        paint = plate.reflectance(a, b)
        nearer = np.isfinite(paint) & (z > 0) & (z < depth)
        depth, reflectance = np.where(nearer, z, depth), np.where(nearer, paint, reflectance)
    away = depth * (NORMAL[0] * x + NORMAL[1] * y + NORMAL[2]) - DISTANCE
    light = RED * reflectance * np.exp(-0.5 * (away / THICK_MM) ** 2) * laser
    channels = [AMBIENT * reflectance, AMBIENT * reflectance, AMBIENT * reflectance + light]
    rng = np.random.default_rng(seed)
    sharp = np.stack(
        [cv2.resize(c, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) for c in channels], -1
    )
    soft = cv2.GaussianBlur(sharp, (0, 0), blur) + rng.normal(0.0, NOISE, sharp.shape)
    return np.clip(np.rint(soft), 0, 255).astype(np.uint8)


def png(picture: np.ndarray) -> bytes:
    return cv2.imencode(".png", picture)[1].tobytes()


def rig_toml(folder: Path, columns: int = COLUMNS, rows: int = ROWS, pitch: float = PITCH) -> None:
    """What a user with a printed chessboard writes, no more."""
    (folder / "rig.toml").write_text(
        f'[board]\nkind = "chessboard"\ncolumns = {columns}\nrows = {rows}\n'
        f"pitch_mm = [{pitch}, {pitch}]\n"
    )


TRUTH = {
    "camera.alpha": FOCAL,
    "camera.beta": FOCAL,
    "camera.u0": CENTRE[0],
    "camera.v0": CENTRE[1],
    **dict(zip(("laser.nx", "laser.ny", "laser.nz"), NORMAL.tolist(), strict=True)),
    "laser.d": DISTANCE,
}


def expect_truth(result: tuple[int, str, str], *named: str, **other: float) -> dict[str, Any]:
    """Everything within four standard uncertainties, which are small; what is told names this."""
    status, out, error = result
    assert status == 0, error
    found = json.loads(out)
    plane = found["light_plane"]
    values = {f"camera.{name}": value for name, value in found["camera"].items()}
    values |= dict(zip(("laser.nx", "laser.ny", "laser.nz"), plane["normal"], strict=True))
    values["laser.d"] = plane["distance_mm"]
    std = found["std"]
    for name, true in (TRUTH | {name.replace("_", "."): v for name, v in other.items()}).items():
        assert abs(values[name] - true) < 4.0 * std[name], name
    assert std["camera.alpha"] < 0.01 * FOCAL
    assert std["laser.d"] < 0.01 * DISTANCE
    for words in named:
        assert words in error
        assert any(words in warning for warning in found["warnings"])
    return found


@pytest.fixture(scope="module")
def good() -> dict[str, np.ndarray]:
    return {f"b{i}.png": photograph([board], seed=i) for i, board in enumerate(BOARDS)}


@pytest.fixture(scope="module")
def searches() -> dict[tuple[Any, ...], BoardPicture]:
    return {}


@pytest.fixture(autouse=True)
def searched_once(
    searches: dict[tuple[Any, ...], BoardPicture], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A picture that stands in many folders is searched once: the same bytes show the same."""

    def remembered(file: PictureFile, board: Board, with_line: bool = True) -> BoardPicture:
        key = (file.path.read_bytes(), str(board), with_line)
        if key not in searches:
            searches[key] = searched_board(file, board, with_line)
        return searches[key]

    monkeypatch.setattr("sheetoflight.workflow.rig_folder.searched_board", remembered)
    monkeypatch.setattr(boards, "searched_board", remembered)


@pytest.fixture
def calibrate(tmp_path: Path, sol: Words) -> Calibrate:
    """Lay pictures into a rig folder and calibrate it."""

    def run(pictures: Pictures, **board: Any) -> tuple[int, str, str]:
        for stage in ("board", "camera"):
            (tmp_path / "rig" / stage).mkdir(parents=True)
        rig_toml(tmp_path / "rig", **board)
        for name, picture in pictures.items():
            content = picture if isinstance(picture, bytes) else png(picture)
            (tmp_path / "rig" / "board" / name).write_bytes(content)
        if not list((tmp_path / "rig" / "camera").iterdir()):
            (tmp_path / "rig" / "camera").rmdir()
        told = sol("calibrate", tmp_path / "rig", "-o", tmp_path / "c.json", "--json")
        assert (tmp_path / "c.json").exists() == (told[0] == 0)
        return told

    return run
