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
        px; right in proportion, and in size where `stated`.
    stated : bool
        Whether the user said how large the noise is (``pixel_std``). Where not, its size is
        estimated from the residuals.
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
    """Size and proportions of the noise.

    The points' own ``std`` give the proportions only. A detector derives them from the grey
    values' noise; what else moves a marker – its print, its light, the lens – it cannot know,
    so the size comes from ``pixel_std``, as the root mean square over all points, or else from
    the residuals. Points without ``std`` count as typical ones.
    """
    own = {
        stage: np.full(views.uv.shape[:2], np.nan) if views.std is None else views.std
        for stage, views in stages.items()
    }
    everywhere = np.concatenate([values.ravel() for values in own.values()] or [np.zeros(0)])
    known = everywhere[np.isfinite(everywhere)]
    typical = float(np.sqrt(np.mean(known**2))) if known.size else 1.0
    size = typical if pixel_std is None else pixel_std
    std = {
        stage: np.where(np.isfinite(values), values, typical) * (size / typical)
        for stage, values in own.items()
    }
    return NoiseModel(std, stated=pixel_std is not None)


def chi2_limit(degrees_of_freedom: int) -> float:
    """Chi-squared that noise alone exceeds once in a thousand times."""
    return float(chdtri(degrees_of_freedom, _FALSE_ALARM))
