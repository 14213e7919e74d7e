"""What is compared when methods of calibration stand side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from sheetoflight.errors import InputError
from sheetoflight.measurement.contestants import CONTESTANTS, PAPER_CASE, Contestant

Case = Literal["sheet", "paper"]

_LENGTHS_MM: Mapping[str, tuple[float, ...]] = {
    "sheet": (20.0, 40.0, 60.0, 150.0, 300.0, 450.0),
    "paper": (20.0, 40.0, 60.0),
}
_FEWEST_TRIALS = 2


@dataclass(frozen=True)
class ComparisonOptions:
    """What is compared on the paper's rig.

    Parameters
    ----------
    case : {"sheet", "paper"}
        ``paper``: its Tables 3 and 4, the lengths and the two methods that stand there.
    methods : tuple of str, optional
        Of `CONTESTANTS`; all, or those of the case, where absent.
    pictures : int
        How many each method is given, over all its stages.
    camera_share : float
        Share of a rod's pictures that is taken in stage camera, and of a plate's that shows
        boards for the camera.
    pixel_std : float
        Standard deviation of the image coordinates of markers and corners, and of the ends of
        the line on a plate, px.
    line_std, end_std : float, optional
        Of a line's points across the line, and of the ends of the lengths measured, px;
        `pixel_std` where absent.
    line_points : int
        Number of points on the line across a board.
    lengths_mm : tuple of float, optional
        20 to 450 mm, or those of the case, where absent.
    segments : int
        How many segments of each length, laid at random into the sheet.
    distortion : (float, float, float, float, float)
        k1, k2, p1, p2, k3 of the lens; the methods estimate as many as are not 0.
    trials : int
    seed : int

    Raises
    ------
    InputError
        If a number makes no sense, or a method is unknown.
    """

    case: Case = "sheet"
    methods: tuple[str, ...] | None = None
    pictures: int = 40
    camera_share: float = 0.75
    pixel_std: float = 0.1
    line_std: float | None = None
    end_std: float | None = None
    line_points: int = 200
    lengths_mm: tuple[float, ...] | None = None
    segments: int = 10
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    trials: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        if self.case not in get_args(Case):
            raise InputError(f"case is '{self.case}'", f"choose {' | '.join(get_args(Case))}")
        usual = tuple(CONTESTANTS) if self.case == "sheet" else PAPER_CASE
        object.__setattr__(self, "methods", self.methods or usual)
        object.__setattr__(self, "lengths_mm", self.lengths_mm or _LENGTHS_MM[self.case])
        self._check_methods()
        self._check_numbers()

    def _check_methods(self) -> None:
        for name in self.methods or ():
            if name not in CONTESTANTS:
                raise InputError(
                    f"method '{name}' cannot be compared", f"choose of {', '.join(CONTESTANTS)}"
                )
        if len(set(self.methods or ())) < len(self.methods or ()):
            raise InputError("a method is named twice", "name every method once")

    def _check_numbers(self) -> None:
        for name, least in (
            ("pictures", 1),
            ("line_points", 2),
            ("segments", 1),
            ("trials", _FEWEST_TRIALS),
            ("seed", 0),
        ):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}", f"give {least} or more")
        if not 0 < self.camera_share < 1:
            raise InputError(f"camera_share is {self.camera_share}", "give a share between 0 and 1")
        sizes = (self.pixel_std, self.line_noise, self.end_noise, *self.lengths)
        if not all(math.isfinite(size) and size > 0 for size in sizes):
            raise InputError(
                f"standard deviations and lengths are {', '.join(f'{s:g}' for s in sizes)}",
                "give numbers above zero",
            )
        if not all(map(math.isfinite, self.distortion)):
            raise InputError(f"distortion is {self.distortion}", "give finite numbers")

    @property
    def contestants(self) -> tuple[Contestant, ...]:
        """Those that are compared."""
        return tuple(CONTESTANTS[name] for name in self.methods or ())

    @property
    def lengths(self) -> tuple[float, ...]:
        """The lengths in mm."""
        return self.lengths_mm or ()

    @property
    def line_noise(self) -> float:
        """Standard deviation of a line's points across the line, px."""
        return self.pixel_std if self.line_std is None else self.line_std

    @property
    def end_noise(self) -> float:
        """Standard deviation of the ends' image coordinates, px."""
        return self.pixel_std if self.end_std is None else self.end_std

    def views(self, contestant: Contestant) -> dict[str, int]:
        """How many pictures of each stage a contestant is given."""
        return contestant.views(self.pictures, self.camera_share)
