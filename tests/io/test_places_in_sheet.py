"""Points of the line whose places in the sheet are known, in ``points.csv``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.observations import Observations

HEADER = "view,stage,marker,u,v,x,y,z\n"


def test_places_come_back_exactly(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    view, std = np.repeat([0, 1, 2], 2), rng.uniform(0.1, 0.3, 6)
    line = LinePixels(
        rng.uniform(0, 900, (6, 2)), std, view, 0 * view, 0 * view, rng.uniform(-90, 90, (6, 2))
    )
    views = BoardViews(("a", "b", "c"), np.empty((3, 0, 2)), line=line)
    write_points(tmp_path / "points.csv", Observations(board=views))
    again = read_points(tmp_path / "points.csv", None).board
    assert again.names == views.names
    for name in ("uv", "std", "view", "laser", "face", "place"):
        assert np.array_equal(getattr(again.line, name), getattr(line, name)), name
    write_points(tmp_path / "again.csv", Observations(board=again))
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "points.csv").read_bytes()


def test_z_may_be_given_as_0_or_left_empty(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(
        HEADER + "a,board,laser,1,2,-3.5,4,0\nb,board,laser,5,6,7,8,\n"
    )
    line = read_points(tmp_path / "points.csv", None).board.line
    assert line.places.tolist() == [[-3.5, 4.0], [7.0, 8.0]]


def test_on_a_board_they_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(HEADER + "a,board,laser,1,2,3,4,0\n")
    board = PlanarBoard("chessboard", 4, 3, (9.0, 9.0))
    line = read_points(tmp_path / "points.csv", None, board=board).board.line
    assert len(line) == 1
    assert np.isnan(line.places).all()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            "a,board,laser,1,2,3,,\n",
            "line 2: a point of the line has the place .3, –, –. mm – give",
        ),
        ("a,board,laser,1,2,,3,0\n", "line 2: a point of the line has the place .–, 3, 0. mm"),
        ("a,board,laser,1,2,3,4,0.5\n", "line 2: .* place .3, 4, 0.5. mm – .* and no z"),
        ("a,board,laser,1,2,,,\n", "line 2: .*no .board. – .*places x, y in the sheet are given"),
        ("a,board,0,1,2,3,4,0\n", "line 2: a point of stage board, but rig.toml has no .board."),
        ("a,board,laser,1,2,left,4,0\n", "line 2: 'x' is 'left', expected a finite number"),
    ],
)
def test_other_places_are_refused_with_their_line(tmp_path: Path, row: str, message: str) -> None:
    (tmp_path / "points.csv").write_text(HEADER + row)
    with pytest.raises(InputError, match=f"points.csv {message}"):
        read_points(tmp_path / "points.csv", None)
