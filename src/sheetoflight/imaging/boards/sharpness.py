"""How wide a chessboard's edges are in the picture."""

from __future__ import annotations

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards.saddles import read_at
from sheetoflight.imaging.boards.second_board import where
from sheetoflight.imaging.markers.grey import Picture

_ACROSS = np.linspace(-0.45, 0.45, 37)
_ALONG = np.linspace(0.3, 0.7, 5)
_WIDEST = 0.4
"""Beyond this a corner's window holds no straight edges any more, and its error grows steeply."""


def too_blurred(values: Picture, grid: Array) -> str | None:
    """Why the corners cannot be measured, if the picture is too blurred for it."""
    width = edge_width(values, grid)
    if width <= _WIDEST:
        return None
    return (
        f"the picture is blurred: the squares' edges at {where(grid)} are {width:.0%} of a square "
        "wide – hold the board still, and focus on it"
    )


def edge_width(values: Picture, grid: Array) -> float:
    """Width of the edges between squares as a share of a square, in the more blurred direction.

    An edge's width is its whole rise over its steepest slope: 2.5 standard deviations of a
    Gaussian blur.

    Parameters
    ----------
    values : (H, W) float32 array
    grid : (rows, columns, 2) array
        Inner corners, px.
    """
    return max(_widths(values, grid), _widths(values, grid.transpose(1, 0, 2)))


def _widths(values: Picture, grid: Array) -> float:
    """Median over the edges that run along the rows."""
    step = np.gradient(grid, axis=0)[:, :-1]
    along = np.diff(grid, axis=1)
    middle = grid[:, :-1] + _ALONG[:, None, None, None] * along
    profile = read_at(values, middle + _ACROSS[:, None, None, None, None] * step).mean(axis=1)
    rise = np.abs(profile[-1] - profile[0])
    slope = np.abs(np.gradient(profile, _ACROSS, axis=0)).max(axis=0)
    return float(np.median(rise / np.maximum(slope, 1e-9)))
