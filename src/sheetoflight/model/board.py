"""Targets of which many points are known: printed boards, and solid bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import fitted_plane

BoardKind = Literal["chessboard", "circles", "charuco"]

_FEWEST_POINTS = 6
"""A solid body's points leave a camera's eleven parameters open below this."""

_FLAT = 1e-9
"""Greatest distance of a face's points from their plane, as a part of the body's size, that is
still rounding."""


@dataclass(frozen=True)
class PlanarBoard:
    """A flat board with a regular pattern.

    Points are numbered row by row: point ``row · columns + column`` is at
    ``(column · pitch_x, row · pitch_y, 0)`` in the board's own frame, mm. In a staggered grid of
    circles every other row is shifted by half the distance between the circles of a row, as
    OpenCV's asymmetric grid has it: ``((2 column + row mod 2) · pitch_x, row · pitch_y, 0)``.

    Parameters
    ----------
    kind : {"chessboard", "circles", "charuco"}
    columns, rows : int
        Inner corners (chessboard, charuco) or circles in a row, and rows of them.
    pitch_mm : (float, float)
        Distance between neighbouring points along x and along y, mm.
    scale_std : float
        Relative standard uncertainty of the whole board's size.
    tolerance_mm : float, optional
        Standard uncertainty of each point's place, mm; estimated from the residuals where absent.
    staggered : bool
        Whether a grid of circles is staggered.
    circle_mm : float, optional
        Diameter of the circles; half the smaller pitch where absent.
    dictionary : str
        Of a charuco board's markers, by OpenCV's name.
    marker_mm : float, optional
        Side of a charuco board's markers; 0.75 of the smaller pitch where absent.

    Raises
    ------
    InputError
        If the board cannot be.

    Examples
    --------
    >>> board = PlanarBoard("chessboard", 3, 2, (10.0, 12.0))
    >>> board.points[4]
    array([10., 12.,  0.])
    """

    kind: BoardKind
    columns: int
    rows: int
    pitch_mm: tuple[float, float]
    scale_std: float = 0.0
    tolerance_mm: float | None = None
    staggered: bool = False
    circle_mm: float | None = None
    dictionary: str = "DICT_4X4_50"
    marker_mm: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in get_args(BoardKind):
            raise InputError(
                f"the board is a '{self.kind}'", f"choose {' | '.join(get_args(BoardKind))}"
            )
        if min(self.columns, self.rows) < 2:
            raise InputError(
                f"the board has {self.columns} columns and {self.rows} rows",
                "count the inner corners, or the circles: at least 2 each way",
            )
        pitch = tuple(float(p) for p in self.pitch_mm)
        object.__setattr__(self, "pitch_mm", pitch)
        if len(pitch) != 2 or not all(math.isfinite(p) and p > 0 for p in pitch):
            raise InputError(
                f"pitch_mm is {list(pitch)}", "give the distances along x and y, above zero"
            )
        _check_uncertainties(self.scale_std, self.tolerance_mm)
        if self.staggered and self.kind != "circles":
            raise InputError(f"a {self.kind} cannot be staggered", "leave staggered out")
        for name in ("circle_mm", "marker_mm"):
            size = getattr(self, name)
            if size is not None and not 0 < size < self._room:
                raise InputError(
                    f"{name} is {size}",
                    f"give more than 0 and less than the {self._room:g} mm"
                    " between neighbouring points",
                )

    @property
    def _room(self) -> float:
        """Least distance between neighbouring points, mm."""
        x, y = self.pitch_mm
        return min(2.0 * x, math.hypot(x, y)) if self.staggered else min(x, y)

    @property
    def circle_diameter(self) -> float:
        """Diameter of a circle in mm."""
        return self.circle_mm or 0.5 * self._room

    @property
    def marker_side(self) -> float:
        """Side of a charuco board's marker in mm."""
        return self.marker_mm or 0.75 * self._room

    @cached_property
    def points(self) -> Array:
        """``(rows · columns, 3)`` in the board's frame, mm."""
        row, column = np.divmod(np.arange(self.rows * self.columns), self.columns)
        if self.staggered:
            column = 2 * column + row % 2
        x, y = self.pitch_mm
        return np.stack([x * column, y * row, np.zeros(len(row))], axis=1)

    @property
    def faces(self) -> Array:
        """``(1, 4)``: the plane ``n · X = c`` on which a line of light is seen, as (n, c)."""
        return np.array([[0.0, 0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class SolidTarget:
    """A rigid body with known points, and flat faces on which a line of light is seen.

    Two boards at an angle, a calibration cube, or a zigzag target of several ridges.

    Parameters
    ----------
    points : (M, 3) array
        In the body's own frame, mm.
    face_points : sequence of sequence of int
        For each face the numbers of three or more points that lie in it.
    scale_std : float
        Relative standard uncertainty of the whole body's size.
    tolerance_mm : float, optional
        Standard uncertainty of each point's place, mm; estimated from the residuals where absent.

    Raises
    ------
    InputError
        If there are fewer than six points, all lie in one plane, or a face's points do not lie in
        one.
    """

    points: Array
    face_points: Sequence[Sequence[int]] = ()
    scale_std: float = 0.0
    tolerance_mm: float | None = None

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise InputError(
                f"the body's points have shape {points.shape} or are not finite",
                "give x, y, z in mm for every point",
            )
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        if len(points) < _FEWEST_POINTS or np.linalg.matrix_rank(points - points.mean(axis=0)) < 3:
            raise InputError(
                f"the body has {len(points)} points, or all of them lie in one plane",
                f"give at least {_FEWEST_POINTS} that do not; a flat target is a board",
            )
        object.__setattr__(self, "face_points", tuple(tuple(face) for face in self.face_points))
        _check_uncertainties(self.scale_std, self.tolerance_mm)
        _ = self.faces

    @cached_property
    def faces(self) -> Array:
        """``(F, 4)``: the planes ``n · X = c`` of the faces, as (n, c)."""
        return np.array([self._face(face) for face in self.face_points]).reshape(-1, 4)

    def _face(self, numbers: Sequence[int]) -> Array:
        if len(set(numbers)) < 3 or not all(0 <= n < len(self.points) for n in numbers):
            raise InputError(
                f"a face is given by the points {list(numbers)}",
                f"name three or more, of 0 to {len(self.points) - 1}",
            )
        corners = self.points[list(numbers)]
        size = float(np.ptp(self.points, axis=0).max())
        if np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=_FLAT * size) != 2:
            raise InputError(
                f"the points {list(numbers)} of a face lie in no plane, or on one line",
                "name points of one flat face that are not on one line",
            )
        normal, distance = fitted_plane(corners)
        return np.append(normal, distance)


Board = PlanarBoard | SolidTarget
"""Whatever has known points and flat faces."""


def _check_uncertainties(scale_std: float, tolerance_mm: float | None) -> None:
    if not (math.isfinite(scale_std) and 0 <= scale_std < 0.1):
        raise InputError(
            f"scale_std is {scale_std}",
            "give the relative standard uncertainty of the board's size: 0.001 for one in a "
            "thousand",
        )
    if tolerance_mm is not None and not (math.isfinite(tolerance_mm) and tolerance_mm >= 0):
        raise InputError(
            f"tolerance_mm is {tolerance_mm}", "give a standard uncertainty of 0 or more, or none"
        )
