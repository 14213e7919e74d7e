"""The coded markers of a charuco board, cell by cell."""

from __future__ import annotations

import cv2

from sheetoflight.errors import InputError
from sheetoflight.model.board import PlanarBoard


def marker_codes(board: PlanarBoard) -> tuple[tuple[tuple[bool, ...], ...], ...]:
    """What is black in each of a charuco board's markers, in the order of their numbers.

    Parameters
    ----------
    board : PlanarBoard
        Its `dictionary` is one of OpenCV's.

    Returns
    -------
    tuple of codes
        One for each white field: rows of cells from the top, the black frame of one cell among
        them.

    Raises
    ------
    InputError
        If the dictionary is not known, or has too few markers.
    """
    number = getattr(cv2.aruco, board.dictionary, None)
    if not board.dictionary.startswith("DICT_") or not isinstance(number, int):
        raise InputError(
            f"the dictionary '{board.dictionary}' is not known",
            "give it by OpenCV's name, such as DICT_4X4_50",
        )
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    needed, held = (board.columns + 1) * (board.rows + 1) // 2, len(dictionary.bytesList)
    if held < needed:
        raise InputError(
            f"the board has {needed} markers, {board.dictionary} only {held}",
            "use a larger dictionary, or fewer columns or rows",
        )
    cells = dictionary.markerSize + 2
    pictures = [cv2.aruco.generateImageMarker(dictionary, i, cells) for i in range(needed)]
    return tuple(tuple(tuple(row) for row in (p == 0).tolist()) for p in pictures)
