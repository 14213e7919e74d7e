"""Finding a printed board in a picture, to a fraction of a pixel.

::

    grey -> the kind's own search (chessboard, circles, charuco) -> refined points and their std
         -> points beside the laser line left out -> sighting
"""

from sheetoflight.imaging.boards.search import find_board
from sheetoflight.imaging.boards.sighting import BoardSearch, BoardSighting

__all__ = ["BoardSearch", "BoardSighting", "find_board"]
