"""How well lengths will be known, before any picture is taken: what a plan asks and says."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sheetoflight.calibration.next_view import NextView
from sheetoflight.calibration.plan import ViewCounts
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.nominal import NominalRig
from sheetoflight.model.rig import Rig

MOST_VIEWS = 300
"""No more views of a kind are planned: nobody lays a target into a sheet so often."""


@dataclass(frozen=True)
class PlanOptions:
    """What is to be planned.

    Parameters
    ----------
    counts : ViewCounts
    length_mm : float, optional
        The length whose uncertainty is told; the target's, or a part of it that fits, where
        absent.
    wanted_mm : float, optional
        A standard uncertainty to be reached.
    best : bool
        Choose the views rather than draw them.
    seed : int

    Raises
    ------
    InputError
        If a length or an uncertainty is not above zero, or the seed negative.
    """

    counts: ViewCounts = field(default_factory=ViewCounts)
    length_mm: float | None = None
    wanted_mm: float | None = None
    best: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("length_mm", "wanted_mm"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"{name} is {value:g}", "give a number of mm above zero")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}", "give a whole number of 0 or more")
        most = max(self.counts.camera, self.counts.plane, self.counts.crossing)
        if most > MOST_VIEWS:
            raise InputError(f"{most} views of one kind are planned", f"plan {MOST_VIEWS} or fewer")


@dataclass(frozen=True)
class ExpectedField:
    """Uncertainty to expect of a length, place by place.

    Parameters
    ----------
    laser : str
    u : (C,) array, v : (R,) array
        The middle of the length is seen there, px.
    depth_mm : (R, C) array
    std_mm, calibration_mm, image_mm : (2, R, C) arrays
        The whole, the calibration's part and that of the ends' image points, for the length
        along the picture's rows and along its columns; NaN where it does not fit.
    """

    laser: str
    u: Array
    v: Array
    depth_mm: Array
    std_mm: Array
    calibration_mm: Array
    image_mm: Array


@dataclass(frozen=True)
class Expected:
    """A standard uncertainty over the field, for random sets of views, mm.

    Parameters
    ----------
    median, low, high : float
        Over sets, of the median over the field: half of the sets are better, four fifths lie
        between; infinite where they do not determine the rig.
    best : float, optional
        Of the chosen set.
    """

    median: float
    low: float
    high: float
    best: float | None = None


@dataclass(frozen=True)
class Wanted:
    """What it takes to reach an uncertainty.

    Parameters
    ----------
    std_mm : float
        What is wanted.
    positions : int or None
        Positions in the sheet, beside the planned other views; None where `MOST_VIEWS` do
        not reach it.
    chosen_positions : int or None
        The same with chosen positions; None also where none were chosen.
    choices : tuple of (int, int or None)
        Numbers of camera views, and of positions that then reach it.
    bound : tuple of (str, float)
        What no number of pictures takes away, by source, mm; adds in squares to `bound_mm`.
    bound_mm : float
    """

    std_mm: float
    positions: int | None
    chosen_positions: int | None
    choices: tuple[tuple[int, int | None], ...]
    bound: tuple[tuple[str, float], ...]
    bound_mm: float

    @property
    def possible(self) -> bool:
        """Whether any number of pictures reaches it."""
        return self.std_mm > self.bound_mm or self.chosen_positions is not None


@dataclass(frozen=True)
class NextPosition:
    """The view that helps most, and the median uncertainty over the field without and with it."""

    view: NextView
    before_mm: float
    after_mm: float


@dataclass(frozen=True)
class LengthPlan:
    """What to expect of a rig.

    Parameters
    ----------
    options : PlanOptions
    rig : Rig
        With its noise stated.
    nominal : NominalRig
    assumptions : tuple of str
        What was not stated, and what was taken instead.
    length_mm : float
        The length that everything is about.
    expected : Expected
        For the planned numbers of views.
    table : tuple of (int, Expected)
        For other numbers of positions in the sheet.
    coarse, fine : tuple of ExpectedField
        One for each laser.
    calibration : Calibration
        The calibration to expect of the typical set, or of the chosen one: the nominal rig with
        its covariance, and the planned views without residuals.
    budget : tuple of (str, float)
        What the uncertainty is made of at the place of the median, by source, mm.
    wanted : Wanted or None
    next_positions : tuple of NextPosition
        The best of each stage, the most useful first.
    after_taken : bool
        Whether these come after views that were taken, not after the planned ones.
    """

    options: PlanOptions
    rig: Rig
    nominal: NominalRig
    assumptions: tuple[str, ...]
    length_mm: float
    expected: Expected
    table: tuple[tuple[int, Expected], ...]
    coarse: tuple[ExpectedField, ...]
    fine: tuple[ExpectedField, ...]
    calibration: Calibration
    budget: tuple[tuple[str, float], ...]
    wanted: Wanted | None
    next_positions: tuple[NextPosition, ...]
    after_taken: bool

    @property
    def headline_mm(self) -> float:
        """Median over the field of the chosen set, or of the typical random one."""
        return self.expected.median if self.expected.best is None else self.expected.best
