"""What commands that look for the laser line have in common: options, and telling of frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from cyclopts import Parameter

from sheetoflight.cli.telling import warn
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.imaging.stripe.extraction import ScanAlong, StripeOptions
from sheetoflight.imaging.stripe.selection import Which
from sheetoflight.imaging.stripe.speckle import Speckle
from sheetoflight.io.frames import DamagedFrame, Frame
from sheetoflight.io.pictures import read_picture
from sheetoflight.workflow.stripes import mask_of

Result = TypeVar("Result")

_MOST_TOLD = 10


@dataclass(frozen=True)
class Looking:
    """How the line is looked for.

    Parameters
    ----------
    detector
        thin, centroid, fir, blais-rioux, parabola, gaussian, steger; or auto, which chooses by
        width, saturation and noise and says what it chose.
    lines
        Where several lines cross the same row (or column): all, the brightest, the first from the
        left (top), or the last.
    scan
        For profile sensors, at camera rate: one centre in each of the columns, or of the rows.
        Left out, lines of any direction are looked for everywhere.
    region
        Left, top, width and height of the part of the picture to look in, px.
    mask
        A picture that is bright where to look.
    off
        A picture of the scene with the laser off, for all pictures that have no such partner.
    speckle
        Contrast, wavelength in nm, f-number and pixel pitch in µm, to add what speckle does to
        each centre's uncertainty: 1 660 8 3.45.
    """

    detector: str = "auto"
    lines: Which = "all"
    scan: ScanAlong | None = None
    region: tuple[int, int, int, int] | None = None
    mask: Path | None = None
    off: Path | None = None
    speckle: tuple[float, float, float, float] | None = None

    @property
    def options(self) -> StripeOptions:
        """The options as the library takes them."""
        return StripeOptions(
            detector=self.detector,
            lines=self.lines,
            scan=self.scan,
            region=self.region,
            mask=None if self.mask is None else mask_of(self.mask),
            speckle=None if self.speckle is None else Speckle(*self.speckle),
        )

    @property
    def background(self) -> np.ndarray | None:
        """The picture with the laser off, where one is given for all."""
        return None if self.off is None else read_picture(self.off)


LookFor = Annotated[Looking, Parameter(name="*")]
"""The options of a command that looks for the line."""


BY_DEFAULT = Looking()
"""Everywhere, by the detector that suits."""


class Damage:
    """Counts frames that could not be used, and tells of the first of them."""

    def __init__(self) -> None:
        self.frames: list[DamagedFrame] = []
        self.used = 0

    def sound(
        self, found: Iterable[tuple[Frame, Result | DamagedFrame]]
    ) -> Iterator[tuple[Frame, Result]]:
        """The frames that could be used, with their results."""
        for frame, result in found:
            if isinstance(result, DamagedFrame):
                self._note(result)
            else:
                self.used += 1
                yield frame, result

    def judge(self, lines: int) -> None:
        """Refuse what has no result at all.

        Raises
        ------
        InputError
            If no frame could be used.
        UntrustworthyError
            If there is no line in any of them.
        """
        if self.used == 0:
            raise InputError(*_told_why(self.frames))
        if lines == 0:
            raise UntrustworthyError(
                "find the line",
                f"no laser line in {self.used} pictures",
                "see that the laser is on and its line bright and narrow; give a picture with the "
                "laser off with --off, or choose the part to look in with --region",
            )

    def refuse_any(self) -> None:
        """Refuse even one frame that could not be used.

        Raises
        ------
        InputError
        """
        if self.frames:
            raise InputError(
                f"{len(self.frames)} of {self.used + len(self.frames)} pictures could not be used",
                "record them again; what could be read was finished",
            )

    def _note(self, damaged: DamagedFrame) -> None:
        self.frames.append(damaged)
        if len(self.frames) <= _MOST_TOLD:
            warn(f"{damaged.why} (skipped)")
        elif len(self.frames) == _MOST_TOLD + 1:
            warn("further pictures that cannot be used are counted, not named")


def _told_why(frames: list[DamagedFrame]) -> tuple[str, str]:
    if not frames:
        return "there is no picture", "name pictures, folders, stacks or videos"
    what, _, remedy = frames[0].why.partition(" – ")
    if len(frames) > 1:
        what = f"none of {len(frames)} pictures could be used; the first: {what}"
    return what, remedy or "record it again"
