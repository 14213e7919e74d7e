"""How the noise of a picture grows with its light, from what a fit leaves over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array

_DARK_PART = 0.1
_LEAST_SAMPLES = 20
_LEAST_REDUNDANCY = 1e-3


@dataclass(frozen=True)
class NoiseLaw:
    """Variance of a sample: read noise plus photon noise, which grows with the light.

    Parameters
    ----------
    dark_variance : float
        Where the laser gives no light, grey levels squared.
    variance_per_level : float
        Growth of the variance with each grey level of the laser's light.
    """

    dark_variance: float
    variance_per_level: float

    def variance(self, light: Array) -> Array:
        """Variance of samples that the laser lights with so many grey levels."""
        return self.dark_variance + self.variance_per_level * np.maximum(light, 0.0)

    def std(self, light: Array) -> Array:
        """Standard deviation of samples that the laser lights with so many grey levels."""
        return np.sqrt(self.variance(light))


UNKNOWN_NOISE = NoiseLaw(1.0, 0.0)
"""One grey level everywhere, where nothing is known yet."""


def noise_law(residuals: Array, light: Array, redundancy: Array, least_std: float) -> NoiseLaw:
    """The law that residuals of a fit to lit samples show.

    Parameters
    ----------
    residuals : (N,) array
        Sample minus model, grey levels.
    light : (N,) array
        The model's laser light in the same samples.
    redundancy : (N,) array
        Part of each sample's variance that the fit has left in its residual: 1 minus its
        leverage. A fit to a narrow line follows its few bright samples and little else.
    least_std : float
        What rounding to whole grey levels alone gives, grey levels.
    """
    bright = light > _DARK_PART * light.max(initial=0.0)
    least = least_std**2
    if (~bright).sum() < _LEAST_SAMPLES or bright.sum() < _LEAST_SAMPLES:
        return NoiseLaw(max(_variance(residuals, redundancy), least), 0.0)
    dark = max(_variance(residuals[~bright], redundancy[~bright]), least)
    excess = _variance(residuals[bright], redundancy[bright]) - dark
    # Samples count by their redundancy in the mean variance, so they do in the mean light.
    mean_light = float(np.average(light[bright], weights=redundancy[bright]))
    return NoiseLaw(dark, max(excess / mean_light, 0.0))


def redundancies(jacobian: Array, information: Array) -> Array:
    """Redundancy ``(..., N)`` of samples from ``(..., N, P)`` derivatives that were fitted with
    weight one, and their information matrix ``(..., P, P)``."""
    leverage = np.sum((jacobian @ np.linalg.pinv(information, hermitian=True)) * jacobian, axis=-1)
    return np.clip(1.0 - leverage, _LEAST_REDUNDANCY, 1.0)


def _variance(residuals: Array, redundancy: Array) -> float:
    return float(np.sum(residuals**2) / max(np.sum(redundancy), _LEAST_REDUNDANCY))
