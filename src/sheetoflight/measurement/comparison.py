"""One measured length beside its known one: the error, its limit, and whether it is kept."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.length import Length, coverage_factor

Decision = Literal["conformity proven", "not proven", "nonconformity proven"]

_ROUNDING_MM = 1e-9
"""A picometre, far above what double precision adds to a length and far below any meaning."""


@dataclass(frozen=True)
class KnownLength:
    """A calibrated length.

    Parameters
    ----------
    value, std : float
        The length and its standard uncertainty, mm; 0 where it is taken as exact.

    Raises
    ------
    InputError
        If the length is not above zero, or the uncertainty is negative.
    """

    value: float
    std: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and self.value > 0):
            raise InputError(f"the known length is {self.value} mm", "give a length above zero")
        if not (math.isfinite(self.std) and self.std >= 0):
            raise InputError(
                f"the known length's standard uncertainty is {self.std} mm",
                "give 0 mm or more, or leave it out where the length is taken as exact",
            )

    @property
    def expanded(self) -> float:
        """Half width of the 95 % interval, mm."""
        return coverage_factor(math.inf) * self.std


@dataclass(frozen=True)
class PermissibleError:
    """Maximum permissible error of a length: a constant part, and one that grows with it.

    Parameters
    ----------
    constant : float
        mm.
    per_m : float
        mm per metre of length.

    Raises
    ------
    InputError
        If a part is negative or not finite, or both are zero.
    """

    constant: float = 0.0
    per_m: float = 0.0

    def __post_init__(self) -> None:
        parts = (self.constant, self.per_m)
        if not all(math.isfinite(part) and part >= 0 for part in parts) or not any(parts):
            raise InputError(
                f"the maximum permissible error is {self}",
                "give parts of 0 or more, at least one of them above zero",
            )

    def __str__(self) -> str:
        parts = [f"{self.constant:g} mm"] if self.constant else []
        parts += [f"{self.per_m:g} mm/m × length"] if self.per_m else []
        return " + ".join(parts) or "0 mm"

    def at(self, length: float) -> float:
        """The limit of the error of a length, both in mm.

        Examples
        --------
        >>> PermissibleError(0.05, per_m=0.1).at(500.0)
        0.1
        """
        return self.constant + self.per_m * length / 1000.0


@dataclass(frozen=True, eq=False)
class MeasuredSegment:
    """A length measured between two image points.

    Parameters
    ----------
    name : str
    ends : (2, 2) array
        Its image points, px.
    length : Length
    laser : str, optional
        In whose sheet it lies; may be left out where there is one laser.
    """

    name: str
    ends: Array
    length: Length
    laser: str | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measured segment beside its known length.

    Parameters
    ----------
    segment : MeasuredSegment
    known : KnownLength
    limit : float, optional
        Maximum permissible error in mm.
    """

    segment: MeasuredSegment
    known: KnownLength
    limit: float | None = None

    @property
    def error(self) -> float:
        """Measured minus known, mm."""
        return self.segment.length.value - self.known.value

    @property
    def expanded(self) -> float:
        """Half width of the error's 95 % interval, of both lengths' uncertainties, mm."""
        low, high = self.segment.length.interval
        return math.hypot((high - low) / 2.0, self.known.expanded)

    @property
    def normalised_error(self) -> float | None:
        """E_n, the error over its expanded uncertainty (ISO/IEC 17043, ISO 13528); None where
        neither length has an uncertainty."""
        return self.error / self.expanded if self.expanded > 0 else None

    @property
    def explained(self) -> bool:
        """Whether the stated uncertainties explain the error: ``|E_n| ≤ 1``."""
        return _within(abs(self.error), self.expanded)

    @property
    def decision(self) -> Decision | None:
        """Whether the limit is proven to be kept, in the sense of ISO 14253-1; None without one.

        The uncertainty that counts is that of the test, not of the tested (ISO 14253-5): the
        known length's alone.
        """
        if self.limit is None:
            return None
        if _within(abs(self.error) + self.known.expanded, self.limit):
            return "conformity proven"
        if _within(abs(self.error) - self.known.expanded, self.limit):
            return "not proven"
        return "nonconformity proven"

    @property
    def severity(self) -> float | None:
        """The error as a share of what is allowed: of the limit, or else of the expanded
        uncertainty."""
        if self.limit is not None:
            return abs(self.error) / self.limit
        return None if self.normalised_error is None else abs(self.normalised_error)

    @property
    def passed(self) -> bool:
        """Whether the error is within the limit or, without one, explained."""
        return self.explained if self.limit is None else _within(abs(self.error), self.limit)


def _within(size: float, limit: float) -> bool:
    return size <= limit + _ROUNDING_MM
