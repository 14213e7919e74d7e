"""Two kinds of evidence of one rig, each solved alone, and whether they agree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from sheetoflight.errors import InputError

Kind = Literal["rod", "board"]
"""The collinear target (stages camera, plane and crossing), or the board (stage board)."""

LEAST_ODDS = 1e-3
"""Below these odds a difference is not put down to chance."""

_ONE_RULER = (
    "measure both with one ruler, and correct markers_mm under [target] or pitch_mm under [board]"
)

_LOOK_AT = (
    "look for a bent board, a target that did not lie in the sheet, a lens that 'distortion' does "
    "not describe, and a camera or laser that moved between the stages"
)


@dataclass(frozen=True)
class Opinion:
    """What one kind of evidence says by itself.

    Parameters
    ----------
    kind : {"rod", "board"}
    views : int
    determines : tuple of str
        ``camera`` and the names of the lasers whose sheets it determines.
    refusal : str
        Why it does not determine what it was asked for; empty where it does.
    """

    kind: Kind
    views: int
    determines: tuple[str, ...]
    refusal: str = ""

    @property
    def in_words(self) -> str:
        """What it determines, and why not more."""
        known = " and ".join(self.determines) or "nothing"
        reason = f": {self.refusal}" if self.refusal else ""
        return f"the {self.kind} alone determines {known}{reason}"


@dataclass(frozen=True)
class Agreement:
    """One parameter by either kind.

    Parameters
    ----------
    name : str
        As in `Covariance`.
    first, second : float
        By the rod and by the board.
    std : float
        Standard uncertainty of their difference.
    """

    name: str
    first: float
    second: float
    std: float

    @property
    def difference(self) -> float:
        """Second less first."""
        return self.second - self.first

    @property
    def z(self) -> float:
        """The difference in its standard uncertainties."""
        if self.difference == 0:
            return 0.0
        return self.difference / self.std if self.std > 0 else math.inf


@dataclass(frozen=True)
class SheetAgreement:
    """The same pixels triangulated by either kind, where the sheet was seen.

    Parameters
    ----------
    laser : str
    points : int
    nearest_mm, farthest_mm : float
        Range of their Z.
    rms_mm, largest_mm : float
        Distance between the two points of a pixel.
    std_mm : float
        Its root mean square that the uncertainties of both let expect.
    """

    laser: str
    points: int
    nearest_mm: float
    farthest_mm: float
    rms_mm: float
    largest_mm: float
    std_mm: float

    @property
    def in_words(self) -> str:
        """The difference beside what is expected."""
        return (
            f"in the sheet {self.laser}, {self.nearest_mm:.0f} to {self.farthest_mm:.0f} mm away, "
            f"their points differ by {self.rms_mm:.2g} mm rms, {self.largest_mm:.2g} mm at most, "
            f"where {self.std_mm:.2g} mm rms are to be expected"
        )


@dataclass(frozen=True)
class ScaleDifference:
    """How far all lengths by the board are longer than those by the rod, by the same factor.

    Parameters
    ----------
    relative, std : float
        The difference as a ratio, and its standard uncertainty.
    odds : float
        Of a difference as large by chance.
    rest_odds : float
        Of differences as large as those that are left when the scale is taken away.
    """

    relative: float
    std: float
    odds: float
    rest_odds: float

    @property
    def disagrees(self) -> bool:
        """Whether it is too large for chance."""
        return self.odds < LEAST_ODDS

    @property
    def in_words(self) -> str:
        """What differs, and what may be wrong."""
        size = 1.0 / (1.0 + self.relative) - 1.0
        what, other = ("larger", "shorter") if size > 0 else ("smaller", "longer")
        return (
            f"lengths by the board are {abs(self.relative):.2%} "
            f"{'longer' if self.relative > 0 else 'shorter'} (± {self.std:.2%}) than by the rod: "
            f"the board is {abs(size):.2%} {what} than stated, or the rod {other}"
        )


@dataclass(frozen=True)
class SecondOpinion:
    """Rod and board, each solved alone, and compared.

    Parameters
    ----------
    rod, board : Opinion
    parameters : tuple of Agreement
        Those that both determine; empty where there are none.
    chi2 : float
        Squared Mahalanobis distance of the differences.
    degrees_of_freedom : int
        Number of independent differences; a sheet has 3.
    noise_freedom : float
        Effective degrees of freedom of the noise that both covariances rest on; infinite where
        all of it was stated.
    odds : float
        Of a `chi2` as large by chance.
    sheets : tuple of SheetAgreement
        Of each laser whose sheet both determine.
    scale : ScaleDifference, optional
        Where both determine a sheet.

    Raises
    ------
    InputError
        If the first opinion is not the rod's, or the second not the board's.
    """

    rod: Opinion
    board: Opinion
    parameters: tuple[Agreement, ...] = ()
    chi2: float = 0.0
    degrees_of_freedom: int = 0
    noise_freedom: float = math.inf
    odds: float = 1.0
    sheets: tuple[SheetAgreement, ...] = ()
    scale: ScaleDifference | None = None

    def __post_init__(self) -> None:
        if (self.rod.kind, self.board.kind) != ("rod", "board"):
            raise InputError(
                f"the opinions are of {self.rod.kind} and {self.board.kind}",
                "give the rod's first, then the board's",
            )

    @property
    def compared(self) -> bool:
        """Whether there is anything that both determine."""
        return bool(self.parameters)

    @property
    def agrees(self) -> bool:
        """Whether chance explains the differences, where there is anything to compare."""
        return self.odds >= LEAST_ODDS and not (self.scale and self.scale.disagrees)

    @property
    def verdict(self) -> tuple[str, ...]:
        """What the comparison says, in sentences."""
        limits = tuple(o.in_words for o in (self.rod, self.board) if o.refusal)
        if not self.compared:
            return ("rod and board have nothing in common that could be compared", *limits)
        causes = () if self.agrees else (" – ".join(self.difference),)
        sheets = tuple(sheet.in_words for sheet in self.sheets)
        return (self.judgement, *causes, *sheets, *limits)

    @property
    def judgement(self) -> str:
        """Whether they agree, in one sentence."""
        what = "agree" if self.agrees else "disagree"
        only = "" if self.sheets else " on the camera, all that both determine"
        return (
            f"rod and board, each solved alone, {what}{only}: chi-squared {self.chi2:.3g} with "
            f"{self.degrees_of_freedom} degrees of freedom, odds {self.odds:.2g}"
        )

    @property
    def scale_only(self) -> bool:
        """Whether they disagree in nothing but the scale."""
        scale = self.scale
        return scale is not None and scale.disagrees and scale.rest_odds >= LEAST_ODDS

    @property
    def difference(self) -> tuple[str, str]:
        """What differs most, and what to look at."""
        scaled = self.scale.in_words if self.scale and self.scale.disagrees else ""
        if self.scale_only:
            return (f"{scaled}; all else agrees", _ONE_RULER)
        worst = max(self.parameters, key=lambda one: abs(one.z))
        most = f"{worst.name} differs most, by {abs(worst.z):.1f} standard uncertainties"
        return (f"{scaled}; {most}" if scaled else most, _LOOK_AT)
