"""What commands that look for the laser line have in common: options, and telling of frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar, get_args

import numpy as np
from cyclopts import Parameter

from sheetoflight.cli.telling import refuse_to_overwrite, warn
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.imaging.stripe.extraction import StripeOptions
from sheetoflight.imaging.stripe.scan.scanner import Detector as ScanDetector
from sheetoflight.imaging.stripe.scanning import ScanAlong
from sheetoflight.imaging.stripe.selection import Which
from sheetoflight.imaging.stripe.speckle import Speckle
from sheetoflight.io.atomic import written_whole
from sheetoflight.io.frames import DamagedFrame, Frame
from sheetoflight.io.pictures import read_picture
from sheetoflight.io.quoting import file_name
from sheetoflight.workflow.stripes import mask_of

Result = TypeVar("Result")

Strict = Annotated[bool, Parameter(name="--strict", negative=())]
"""The flag of commands that finish what they can, and may be asked to fail after it."""

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
        Which to keep where several lines cross the same row (or column): all, the brightest, the
        first from the left (top), or the last.
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
        Contrast, wavelength in nm, f-number and pixel pitch in µm, such as 1 660 8 3.45: no
        centre is then stated to be better than speckle allows.
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
        if self.scan and self.detector not in ("auto", *get_args(ScanDetector)):
            raise InputError(
                f"--scan does not work with the detector {self.detector!r}",
                f"choose auto | {' | '.join(get_args(ScanDetector))}, or leave out --scan",
            )
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

    @property
    def files(self) -> list[Path]:
        """What is read besides the pictures."""
        return [path for path in (self.mask, self.off) if path]


LookFor = Annotated[Looking, Parameter(name="*")]
"""The options of a command that looks for the line."""


BY_DEFAULT = Looking()
"""Everywhere, by the detector that suits."""


class _AbandonedError(Exception):
    """Nothing is to be written after all."""


def check_output(output: Path, read: Iterable[Path]) -> None:
    """Refuse an output that cannot be, before the work that it is for.

    Raises
    ------
    FileError
        If it cannot be written where it is to be.
    InputError
        If it is one of the files that are read, under whatever name, or a rig folder's own.
    """
    with suppress(_AbandonedError), written_whole(output):
        raise _AbandonedError
    there = output.exists()
    refuse_to_overwrite(output, [path for path in read if there and _is_same(path, output)])


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:
        return False


def counted(number: int, thing: str) -> str:
    """So many of a thing.

    Examples
    --------
    >>> counted(1, "picture"), counted(0, "picture")
    ('1 picture', '0 pictures')
    """
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


class Damage:
    """Counts frames that could not be used, and tells of the first of them.

    Parameters
    ----------
    keep : bool
        Remember all of them in `frames`, else as many as are told.
    """

    def __init__(self, keep: bool = False) -> None:
        self.frames: list[DamagedFrame] = []
        self.count = 0
        self.used = 0
        self._keep, self._told = keep, 0

    def sound(
        self, found: Iterable[tuple[Frame, Result | DamagedFrame]]
    ) -> Iterator[tuple[Frame, Result]]:
        """The frames that could be used, with their results."""
        for frame, result in found:
            if isinstance(result, DamagedFrame):
                self._note(result)
            else:
                self._use()
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
            raise InputError(*_told_why(self.frames, self.count))
        if lines == 0:
            raise UntrustworthyError(
                "stripe",
                f"no laser line in {counted(self.used, 'picture')}",
                "see that the laser is on and its line bright and narrow; give a picture with the "
                "laser off with --off, or choose the part to look in with --region",
            )

    def refuse_any(self) -> None:
        """Refuse even one frame that could not be used.

        Raises
        ------
        InputError
        """
        if self.count:
            raise InputError(
                f"{self.count} of {counted(self.used + self.count, 'picture')} could not be used",
                "record them again; what could be read was finished",
            )

    @property
    def ending(self) -> str:
        """How many were left out, as the end of a sentence; empty where none was."""
        return f", {self.count} skipped" if self.count else ""

    def skipped(self) -> list[dict[str, str]]:
        """The frames that could not be used, for programs."""
        return [{"image": file_name(one.frame.name), "why": one.why} for one in self.frames]

    def _use(self) -> None:
        self.used += 1
        if self.used == 1:
            self._tell()

    def _note(self, damaged: DamagedFrame) -> None:
        self.count += 1
        if self._keep or self.count <= _MOST_TOLD:
            self.frames.append(damaged)
        if self.used:  # until then it may become the error that all have in common
            self._tell()

    def _tell(self) -> None:
        for damaged in self.frames[self._told : _MOST_TOLD]:
            warn(f"{damaged.why} (skipped)")
        if self.count > _MOST_TOLD >= self._told:
            warn("further pictures that cannot be used are counted, not named")
        self._told = self.count


def _told_why(frames: Sequence[DamagedFrame], count: int) -> tuple[str, str]:
    if not frames:
        return "there is no picture", "name pictures, folders, stacks or videos"
    what, _, remedy = frames[0].why.partition(" – ")
    if count > 1:
        what = f"none of {count} pictures could be used; the first: {what}"
    return what, remedy or "record it again"
