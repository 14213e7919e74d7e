"""Pictures of stage board: the board, and the laser's line across it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.boards import BoardSighting, find_board
from sheetoflight.imaging.stripe.extraction import extract_stripe
from sheetoflight.io.pictures import PictureFile, read_picture
from sheetoflight.io.quoting import file_name
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.board_views import BoardViews, LinePixels


@dataclass(frozen=True)
class BoardPicture:
    """What one picture of stage board, or a pair, shows.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture, px.
    sighting : BoardSighting or None
        None where the board was not found.
    line_uv : (P, 2) array
        Centres of the laser's line, on the board and beside it, px.
    line_std : (P,) array
        Their standard uncertainties across the line, px.
    reason : str
        What was found, or why there is no sighting.
    """

    size: tuple[int, int]
    sighting: BoardSighting | None
    line_uv: Array
    line_std: Array
    reason: str

    @property
    def seen(self) -> bool:
        """Whether the picture is of use."""
        return self.sighting is not None


def searched_board(file: PictureFile, board: Board, with_line: bool = True) -> BoardPicture:
    """Search a picture for the board, and for the laser's line.

    Of a pair, the board is searched for with the laser off, and the line in what the laser adds.

    Parameters
    ----------
    file : PictureFile
    board : Board
    with_line : bool
        Whether there may be a line.

    Raises
    ------
    FileError, InputError
        If a picture cannot be used; the message names it.
    """
    if not isinstance(board, PlanarBoard):
        raise InputError(
            f"{file_name(file.path)}: the points of a solid body are not searched for in pictures",
            "give them in points.csv (stage board)",
        )
    picture = read_picture(file.path)
    on = None if file.laser_on is None else read_picture(file.laser_on)
    height, width = picture.shape[:2]
    nothing = (np.zeros((0, 2)), np.zeros(0))
    try:
        search = find_board(picture, board, on)
        if search.sighting is None:
            return BoardPicture((width, height), None, *nothing, search.reason)
        stripe = (
            (extract_stripe(picture) if on is None else extract_stripe(on, picture))
            if with_line
            else None
        )
    except InputError as error:
        name = file_name(file.laser_on or file.path)
        raise InputError(f"{name}: {error.what}", error.remedy) from error
    line = nothing if stripe is None else (stripe.uv[stripe.good], stripe.std[stripe.good])
    return BoardPicture((width, height), search.sighting, *line, search.reason)


def board_views(
    names: Sequence[str], lasers: Sequence[int], found: Sequence[BoardPicture]
) -> BoardViews:
    """The views in which the board was found.

    Parameters
    ----------
    names, lasers : sequence
        Name of each view, and the number of the laser that is on in it.
    found : sequence of BoardPicture
    """
    seen = [
        (name, laser, picture, picture.sighting)
        for name, laser, picture in zip(names, lasers, found, strict=True)
        if picture.sighting is not None
    ]
    if not seen:
        return BoardViews()
    counts = [len(picture.line_uv) for _, _, picture, _ in seen]
    line = LinePixels(
        np.concatenate([picture.line_uv for _, _, picture, _ in seen]),
        np.concatenate([picture.line_std for _, _, picture, _ in seen]),
        np.repeat(np.arange(len(seen)), counts),
        np.repeat([laser for _, laser, _, _ in seen], counts),
        np.zeros(sum(counts)),
    )
    return BoardViews(
        tuple(name for name, _, _, _ in seen),
        np.stack([sighting.uv for _, _, _, sighting in seen]),
        np.stack([sighting.std for _, _, _, sighting in seen]),
        line,
    )
