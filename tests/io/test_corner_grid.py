"""Other tools' corners put onto a board of columns and rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from sheetoflight.errors import InputError
from sheetoflight.io.exchange import read_corners, write_corners
from sheetoflight.io.exchange.corner_grid import even_board
from sheetoflight.io.points_csv import read_points


def grid(columns: int, rows: int, x: float = 30.0, y: float = 20.0) -> np.ndarray:
    """``(M, 3)``, row by row."""
    row, column = np.divmod(np.arange(columns * rows), columns)
    return np.column_stack([x * column, y * row, np.zeros(columns * rows)])


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (-60.0, 17.3, 5.0)])
def test_the_board_is_found_whatever_the_order_and_the_origin(shift: tuple[float, ...]) -> None:
    rng = np.random.default_rng(1)
    order = rng.permutation(35)
    board, places = even_board((grid(7, 5) + shift)[order])
    assert (board.kind, board.columns, board.rows) == ("chessboard", 7, 5)
    assert board.pitch_mm == pytest.approx((30.0, 20.0), rel=1e-12)
    assert places.tolist() == order.tolist()


def test_points_that_no_view_shows_leave_their_places_open() -> None:
    """Without the corners of a whole column and of single places the pitch is still the same."""
    points = grid(7, 5)
    left = np.ones(35, dtype=bool)
    left[[3, 10, 17, 24, 31, 0, 18]] = False
    board, places = even_board(points[left])
    assert (board.columns, board.rows, board.pitch_mm) == (7, 5, (30.0, 20.0))
    assert places.tolist() == np.flatnonzero(left).tolist()


def test_numbers_of_another_precision_are_even_still() -> None:
    """A pitch that has no exact number, kept in single precision: places to 1e-7."""
    points = grid(9, 6, 100.0 / 3.0, 25.4).astype(np.float32).astype(float)
    board, places = even_board(points)
    assert (board.columns, board.rows) == (9, 6)
    assert places.tolist() == list(range(54))


UNEVEN = {
    "a point off its place": (
        grid(4, 3) + 3.0 * (np.arange(12) == 5)[:, None] * [1.0, 0.0, 0.0],
        "not evenly spaced along x",
    ),
    "two sizes of squares": (
        np.vstack([grid(4, 3), grid(4, 3, 29.0)]),
        "not evenly spaced along x.*same dX and dY in all pictures",
    ),
    "one line": (grid(4, 1), "all its board points have the same y"),
    "a solid body": (grid(4, 3) + np.outer(np.arange(12), [0, 0, 1.0]), "one plane of constant z"),
}


@pytest.mark.parametrize("case", UNEVEN)
def test_what_is_no_even_board_is_refused(case: str) -> None:
    points, said = UNEVEN[case]
    with pytest.raises(InputError, match=said):
        even_board(points)


def saved(folder: Path, **more: float | np.ndarray) -> Path:
    """Two views: the whole board, and its two first rows."""
    points = grid(4, 3)
    variables = {
        "X_1": points.T,
        "x_1": points[:, :2].T + 100.25,
        "X_2": points[:8].T,
        "x_2": 2.0 * points[:8, :2].T + 50.5,
    }
    savemat(folder / "calib_data.mat", variables | more)
    return folder / "calib_data.mat"


def test_written_corners_are_read_as_they_were(tmp_path: Path) -> None:
    corners = read_corners(saved(tmp_path, nx=640.0, ny=480.0))
    assert corners.image_size == (640, 480)
    write_corners(tmp_path / "points.csv", corners)
    found = read_points(tmp_path / "points.csv", None, board=corners.board).board
    assert found.names == ("1", "2")
    np.testing.assert_array_equal(found.uv[0], grid(4, 3)[:, :2] + 100.25)
    np.testing.assert_array_equal(found.uv[1, :8], 2.0 * grid(4, 2)[:, :2] + 50.5)
    assert np.isnan(found.uv[1, 8:]).all()
    header, row, *_ = (tmp_path / "points.csv").read_text().splitlines()
    assert header == "view,stage,marker,u,v,x,y,z"
    assert row == "1,board,0,100.25,100.25,0.0,0.0,0.0"


def test_the_picture_size_may_be_missing_but_not_wrong(tmp_path: Path) -> None:
    assert read_corners(saved(tmp_path)).image_size is None
    assert read_corners(saved(tmp_path, nx=640.0)).image_size is None
    for wrong in (640.5, -1.0, np.zeros((0, 0)), np.ones(2)):
        with pytest.raises(InputError, match=r"calib_data\.mat: nx, ny"):
            read_corners(saved(tmp_path, nx=wrong, ny=480.0))
