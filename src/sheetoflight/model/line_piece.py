"""A connected piece of the laser line in one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class LinePiece:
    """One unbroken piece of the laser line.

    Parameters
    ----------
    uv : (N, 2) array
        Centres along the piece in px, in order from its first end to its second.
    std : (N,) array
        Standard uncertainty of each centre across the line, px.
    ends : (2, 2) array
        First and second end in px.
    ends_std : (2,) array
        Standard uncertainty of each end along the line, px; NaN where no edge ends the piece.
    whole : bool
        Whether both ends are edges of the lit surface; False where the piece leaves the picture,
        fades out, or bends sharply.
    """

    uv: Array
    std: Array
    ends: Array
    ends_std: Array
    whole: bool = True

    def __len__(self) -> int:
        return int(np.shape(self.uv)[0])
