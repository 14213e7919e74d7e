"""A bare plate that a stage moves along a sheet of light, as a camera sees the line on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.simulation.rig import SimulatedRig, field_centre


@dataclass(frozen=True)
class SteppedPlate:
    """A plate at a right angle to the sheet, and a stage that travels in it.

    Parameters
    ----------
    edges_mm : sequence of float
        Where along the line the plate's edges are, from the middle of the field: two of a plain
        plate, four of one with a slot.
    travel_mm : sequence of float
        Positions of the stage, from the middle of the field.
    turn : float
        Angle of the line to the sheet's first direction, rad.
    laser : int
        Whose sheet it is.
    """

    edges_mm: Sequence[float] = (-100.0, 100.0)
    travel_mm: Sequence[float] = (-150.0, -75.0, 0.0, 75.0, 150.0)
    turn: float = 0.3
    laser: int = 0

    @property
    def places(self) -> Array:
        """``(S, E, 2)`` places of the edges in the sheet at every step, mm: along the line, and
        by the travel."""
        x, y = np.meshgrid(self.edges_mm, self.travel_mm)
        return np.stack([x, y], axis=-1)

    def points(self, rig: SimulatedRig) -> Array:
        """``(S, E, 3)`` these in space, mm, camera frame.

        Raises
        ------
        InputError
            If the sheet is curved.
        """
        sheet = rig.flat_sheet(self.laser, "a stage's places are those of a plane")
        first, second = tangent_basis(sheet.normal)
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        along, ahead = cos * first + sin * second, cos * second - sin * first
        way = self.places[..., :1] * along + self.places[..., 1:] * ahead
        return field_centre(rig, self.laser) + way


def stepped_plate_views(
    rig: SimulatedRig,
    plate: SteppedPlate,
    rng: np.random.Generator,
    pixel_std: float = 0.0,
    stage_std: float = 0.0,
) -> BoardViews:
    """What is seen of the ends of the line on the plate, step by step.

    Points outside the picture are left out.

    Parameters
    ----------
    rig : SimulatedRig
    plate : SteppedPlate
    rng : numpy.random.Generator
    pixel_std : float
        Standard deviation of both image coordinates, px.
    stage_std : float
        Standard deviation of the positions that the stage tells, mm.

    Returns
    -------
    BoardViews
        Of no board; the line's points with their places in the sheet.
    """
    points, places = plate.points(rig), plate.places
    uv = rig.camera.project(points)
    uv = uv + rng.normal(scale=pixel_std, size=uv.shape) if pixel_std else uv
    if stage_std:
        places[..., 1] += rng.normal(scale=stage_std, size=(len(places), 1))
    inside = ((uv >= 0) & (uv <= np.array(rig.camera.image_size) - 1.0)).all(axis=2)
    count = int(inside.sum())
    line = LinePixels(
        uv[inside],
        np.full(count, pixel_std if pixel_std else np.nan),
        np.nonzero(inside)[0],
        np.full(count, plate.laser),
        np.zeros(count),
        places[inside],
    )
    width = max(2, len(str(len(uv) - 1)))
    names = tuple(f"step{step:0{width}d}" for step in range(len(uv)))
    return BoardViews(names, np.empty((len(uv), 0, 2)), line=line)
