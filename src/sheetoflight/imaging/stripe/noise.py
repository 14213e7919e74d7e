"""How the noise of a picture grows with its light, from what a fit leaves over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array

_DARK_PART = 0.1
_LEAST_SAMPLES = 20


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

    def std(self, light: Array) -> Array:
        """Standard deviation of samples that the laser lights with so many grey levels."""
        return np.sqrt(self.dark_variance + self.variance_per_level * np.maximum(light, 0.0))


def noise_law(residuals: Array, light: Array, freedom: float, least_std: float) -> NoiseLaw:
    """The law that residuals of a fit to lit samples show.

    Parameters
    ----------
    residuals : (N,) array
        Sample minus model, grey levels.
    light : (N,) array
        The model's laser light in the same samples.
    freedom : float
        Degrees of freedom of the fit as a part of N.
    least_std : float
        What rounding to whole grey levels alone gives, grey levels.
    """
    squares = residuals**2 / max(freedom, 0.1)
    bright = light > _DARK_PART * light.max(initial=0.0)
    least = least_std**2
    if (~bright).sum() < _LEAST_SAMPLES or bright.sum() < _LEAST_SAMPLES:
        return NoiseLaw(max(float(np.mean(squares)), least), 0.0)
    dark = max(float(np.mean(squares[~bright])), least)
    growth = float(np.mean(squares[bright]) - dark) / float(np.mean(light[bright]))
    return NoiseLaw(dark, max(growth, 0.0))
