"""Where residuals come from that are larger than noise."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One cause that the residuals point to.

    Parameters
    ----------
    stage : str
        What to look at: ``camera``, ``plane``, ``crossing`` or ``target``.
    cause : str
        ``bent target``, ``wrong marker distance``, ``slipped pivot``, ``unmodelled distortion``,
        ``moved laser``, ``noisy stage``.
    text : str
        What was found, with its size.
    remedy : str
        What to do.
    explained : float
        Share of the residuals' chi-squared that this cause takes away.
    odds : float
        Odds of that by chance.
    shift : float
        How far correcting it would move the parameters, at most, in their standard
        uncertainties.
    """

    stage: str
    cause: str
    text: str
    remedy: str
    explained: float
    odds: float
    shift: float = 0.0

    @property
    def in_words(self) -> str:
        """For a warning."""
        return (
            f"stage {self.stage}: {self.text}, which explains {self.explained:.0%} of the "
            f"residuals – {self.remedy}"
        )
