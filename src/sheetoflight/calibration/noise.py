"""How large the noise is said to be, and how large it turns out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import TargetViews

_FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class NoiseModel:
    """Standard uncertainties of the image coordinates.

    Parameters
    ----------
    std : mapping from stage to (N, M) array
        px; 1 throughout where nothing is known.
    stated : bool
        Whether the user (``pixel_std``) or the detection (``std``) stated them. Where not,
        their common scale is estimated from the residuals.
    """

    std: Mapping[str, Array]
    stated: bool

    def variance_factor(self, chi2: float, degrees_of_freedom: int) -> float:
        """By how much the variances must grow to agree with the residuals.

        Stated variances never shrink: residuals that look too good do not prove them wrong.
        """
        if degrees_of_freedom <= 0:
            return 1.0
        factor = chi2 / degrees_of_freedom
        return max(factor, 1.0) if self.stated else factor

    def typical_std(self, factor: float) -> float:
        """Root mean square standard uncertainty of all image coordinates, px."""
        squares = np.concatenate([std.ravel() ** 2 for std in self.std.values()])
        return float(np.sqrt(factor * squares.mean()))


def noise_model(stages: Mapping[str, TargetViews], pixel_std: float | None) -> NoiseModel:
    """A view's own ``std`` where it has one, else ``pixel_std``, else unknown."""
    stated = True
    std = {}
    for stage, views in stages.items():
        own = np.full(views.uv.shape[:2], np.nan) if views.std is None else views.std
        known = np.isfinite(own)
        if pixel_std is None:
            stated = stated and bool(known[views.seen].all())
        std[stage] = np.where(known, own, pixel_std if pixel_std is not None else 1.0)
    if not stated:
        std = {stage: np.ones_like(values) for stage, values in std.items()}
    return NoiseModel(std, stated)


def chi2_limit(degrees_of_freedom: int) -> float:
    """Chi-squared that noise alone exceeds once in a thousand times."""
    return float(chdtri(degrees_of_freedom, _FALSE_ALARM))
