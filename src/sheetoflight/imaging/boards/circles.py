"""Finding a grid of circles, and the images of their centres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.circle_centres import centres_of
from sheetoflight.imaging.boards.grid import is_mirrored, numberings, spacing, upper_left_first
from sheetoflight.imaging.boards.homography import mapped, on_grid, plane_to_picture
from sheetoflight.imaging.boards.second_board import where
from sheetoflight.imaging.boards.sighting import FoundPoints
from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.discs import DiscOptions, disc_candidates
from sheetoflight.imaging.markers.fit import FitOptions, fitted_marker
from sheetoflight.imaging.markers.grey import GreyPicture
from sheetoflight.model.board import PlanarBoard

_CANDIDATES_A_CIRCLE = 3
_FIT = FitOptions(surround=1.3, most_pixels=1500)
_OTHER_SIZES = ((-1, 0), (0, -1), (1, 0), (0, 1), (-1, -1), (-2, 0), (0, -2), (0, 2))
_MIRRORED = (
    "the picture is mirrored: the staggered grid's rows are shifted the wrong way – switch the "
    "flip off in the camera's software, or correct rows in [board]"
)
_ALIKE = 3.0
_TRIES = 3

_FARTHEST_OFF = 0.35
"""Squares of the grid that a circle may lie from where the plane has it; lenses distort."""


def find_circles(picture: GreyPicture, board: PlanarBoard) -> FoundPoints | str:
    """The images of a grid of circles' centres, or why there are none.

    Of the numberings that run the right way round, point 0 is the one nearest to the picture's
    upper left corner. A mirrored picture can be told only by a staggered grid with an even number
    of rows.

    Parameters
    ----------
    picture : GreyPicture
    board : PlanarBoard
        Of kind ``circles``.
    """
    most = _CANDIDATES_A_CIRCLE * board.columns * board.rows
    candidates = disc_candidates(picture, replace(DiscOptions(), most=max(most, 150)))
    for discs in _alike(candidates):
        members = _grid_of(discs, board)
        if members is not None:
            return _checked(picture, discs, members, board)
    return _why_not(candidates, board)


def _alike(candidates: Sequence[Candidate]) -> list[list[Candidate]]:
    """The dark discs and the light ones, without those that are much fainter or of another size
    than most."""
    groups = []
    for dark in (True, False):
        discs = [c for c in candidates if (c.contrast > 0) is dark]
        contrast = np.median([abs(c.contrast) for c in discs] or [0.0])
        radius = np.median([c.radius for c in discs] or [0.0])
        groups.append([
            c for c in discs
            if abs(c.contrast) > contrast / _ALIKE and radius / _ALIKE < c.radius < _ALIKE * radius
        ])  # fmt: skip
    return groups


def _grid_of(
    discs: Sequence[Candidate], board: PlanarBoard, tries: int = _TRIES
) -> np.ndarray | None:
    """Numbers ``(rows, columns)`` of the discs that form the grid, or None."""
    count = board.columns * board.rows
    if len(discs) < count:
        return None
    uv = np.array([d.centre for d in discs], dtype=np.float32)
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if board.staggered else cv2.CALIB_CB_SYMMETRIC_GRID
    for flags, seed in product((kind, kind | cv2.CALIB_CB_CLUSTERING), range(tries)):
        # OpenCV looks for the grid's two directions from random starts.
        cv2.setRNGSeed(seed)
        found, centres = cv2.findCirclesGrid(
            uv[:, None],
            (board.columns, board.rows),
            flags,
            None,  # type: ignore[arg-type]  # then the first argument holds points
            cv2.CirclesGridFinderParameters(),
        )
        if found:
            away = np.linalg.norm(np.asarray(centres).reshape(-1, 1, 2) - uv, axis=-1)
            members = _in_order(uv, away.argmin(axis=1), board)
            if members is not None:
                return members
    return None


def _in_order(uv: Array, members: np.ndarray, board: PlanarBoard) -> np.ndarray | None:
    """The members of the grid in an order that suits a plane board, or None.

    OpenCV sometimes takes the odd rows of a staggered grid for the even ones.
    """
    if len(set(members)) < len(members):
        return None
    order = members.reshape(board.rows, board.columns)
    orders = [order]
    if board.staggered and board.rows % 2 == 0:
        swapped = order.reshape(-1, 2, board.columns)[:, ::-1].reshape(order.shape)
        orders = [o for both in (order, swapped) for o in (both, both[:, ::-1])]
    return next((o for o in orders if _lies_in_a_plane(uv[o.ravel()], board)), None)


def _lies_in_a_plane(uv: Array, board: PlanarBoard) -> bool:
    matrix = plane_to_picture(board, uv)
    if matrix is None:
        return False
    grid = on_grid(matrix, board)
    off = np.linalg.norm(grid.reshape(-1, 2) - uv, axis=1)
    return bool(off.max() < _FARTHEST_OFF * spacing(grid))


def _checked(
    picture: GreyPicture, discs: Sequence[Candidate], members: np.ndarray, board: PlanarBoard
) -> FoundPoints | str:
    centres = np.array([d.centre for d in discs])
    grid = centres[members]
    choices = _numberings(grid, board)
    if not choices:
        return _MIRRORED
    grid = upper_left_first(choices)
    if _goes_on(grid, centres, board):
        return (
            f"the grid of circles at {where(grid)} is larger than {board.columns} × {board.rows} – "
            "correct columns and rows in [board]"
        )
    others = [d for i, d in enumerate(discs) if i not in set(members.ravel())]
    second = _grid_of(others, board)
    if second is not None:
        place = where(np.array([d.centre for d in others])[second])
        return (
            f"two boards are in the picture, at {where(grid)} and {place} – leave one of them in "
            "view"
        )
    number = np.linalg.norm(grid.reshape(-1, 1, 2) - centres, axis=-1).argmin(axis=1)
    return _measured(picture, [discs[i] for i in number], board)


def _numberings(grid: Array, board: PlanarBoard) -> list[Array]:
    if board.staggered:
        return staggered_numberings(grid)
    return numberings(grid, board.columns, board.rows)


def staggered_numberings(grid: Array) -> list[Array]:
    """The numberings of a staggered grid that run the right way round.

    Half a turn carries a grid with an even number of rows into itself; a reflection of the rows
    one with an odd number. An even one whose axes turn the wrong way is a mirror image.
    """
    if len(grid) % 2:
        return [grid[::-1] if is_mirrored(grid) else grid]
    return [] if is_mirrored(grid) else [grid, grid[::-1, ::-1]]


def _goes_on(grid: Array, centres: Array, board: PlanarBoard) -> bool:
    """Whether there are circles all along a further row or column."""
    matrix = plane_to_picture(board, grid.reshape(-1, 2))
    if matrix is None:
        return False
    for side in _beyond(board):
        away = np.linalg.norm(mapped(matrix, side)[:, None] - centres, axis=-1).min(axis=1)
        if (away < _FARTHEST_OFF * spacing(grid)).all():
            return True
    return False


def _beyond(board: PlanarBoard) -> list[Array]:
    """Places ``(n, 2)`` mm on the board of a further row or column on each of the four sides."""
    across, down = np.arange(board.columns), np.arange(board.rows)
    sides = ((across, 0 * across - 1), (across, 0 * across + board.rows),
             (0 * down - 1, down), (0 * down + board.columns, down))  # fmt: skip
    places = []
    for column, row in sides:
        x = 2 * column + row % 2 if board.staggered else column
        places.append(np.stack([x, row], axis=-1) * np.array(board.pitch_mm))
    return places


def _measured(picture: GreyPicture, discs: Sequence[Candidate], board: PlanarBoard) -> FoundPoints:
    fits = [fitted_marker(picture, disc, quadrant=False, options=_FIT) for disc in discs]
    uv = np.array([[np.nan, np.nan] if f is None else f.uv for f in fits])
    shapes = [d if f is None else f.shape for d, f in zip(discs, fits, strict=True)]
    frames = np.array([shape.frame for shape in shapes])
    std = np.array([np.nan if f is None else np.sqrt(np.trace(f.covariance) / 2) for f in fits])
    reach = _FIT.surround * np.linalg.norm(frames, ord=2, axis=(1, 2))
    return FoundPoints(centres_of(uv, frames, board), std, reach)


def _why_not(candidates: Sequence[Candidate], board: PlanarBoard) -> str:
    asked = f"{board.columns} × {board.rows}"
    groups = _alike(candidates)
    if board.staggered and any(_grid_of(_flipped(discs), board) is not None for discs in groups):
        return _MIRRORED
    for more_columns, more_rows in _OTHER_SIZES:
        columns, rows = board.columns + more_columns, board.rows + more_rows
        other = replace(board, columns=max(columns, 2), rows=max(rows, 2))
        for discs in groups:
            members = _grid_of(discs, other, tries=1)
            if members is not None:
                place = where(np.array([d.centre for d in discs])[members])
                return (
                    f"found a grid of {columns} × {rows} circles at {place}, [board] says {asked} "
                    "– correct columns and rows, or bring the whole board into view"
                )
    dark, light = (len(discs) for discs in groups)
    return (
        f"no grid of {asked} circles found: {dark} dark and {light} light discs are in the picture "
        "– bring the whole board into view, sharp and evenly lit"
    )


def _flipped(discs: Sequence[Candidate]) -> list[Candidate]:
    """The discs as a mirror shows them."""
    return [replace(d, centre=d.centre * np.array([-1.0, 1.0])) for d in discs]
