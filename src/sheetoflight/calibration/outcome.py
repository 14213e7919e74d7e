"""What a method of calibration hands over."""

from __future__ import annotations

from dataclasses import dataclass

from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.uncertainty import Influence


@dataclass(frozen=True)
class Outcome:
    """What a method found.

    Parameters
    ----------
    state : RigState
    influence : Influence
        Where the errors of its parameters come from.
    fits : tuple of Fit
        All residuals.
    noise : Fit
        The fit whose residuals told the noise.
    warnings : tuple of str
    """

    state: RigState
    influence: Influence
    fits: tuple[Fit, ...]
    noise: Fit
    warnings: tuple[str, ...] = ()
