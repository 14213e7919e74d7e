"""What neighbouring rows know of each other: width and background slope vary little along a line.

Each row's fit alone must tell five unknowns from few samples. The slope of the background takes
part of the centre's precision (10 % with samples to four standard deviations), and in the dark the
width is hardly known. How much both truly vary from row to row shows in the fits themselves: the
scatter of the estimates less their own variance (empirical Bayes; B. Efron, C. Morris, JASA 68,
1973). Nothing is borrowed for the centre: neighbouring centres stay independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sheetoflight.geometry.directions import Array

_WIDTH, _SLOPE = 2, 4
_LEAST_ROWS = 20
_ROWS = 61
_LEAST_RELATIVE_SPREAD = 0.02
_QUANTILES = (0.1587, 0.8413)


@dataclass(frozen=True)
class Prior:
    """Means and information (1/variance) ``(N, 5)`` of each row's parameters."""

    mean: Array
    information: Array


def no_prior(rows: int) -> Prior:
    """Nothing known."""
    return Prior(np.zeros((rows, 5)), np.zeros((rows, 5)))


def pooled(fit: Array, covariance: Array, still: NDArray[np.bool_]) -> Prior:
    """What all rows together say of each row's width and background slope.

    Parameters
    ----------
    fit : (N, 5) array
        Amplitude, centre, width, background level and slope of each row's own fit.
    covariance : (N, P, P) array
        Their covariances; without slope where P is 4.
    still : (N,) bool array
        Whether the fit came to rest.
    """
    prior = no_prior(len(fit))
    if still.sum() < _LEAST_ROWS:
        return prior
    index = np.flatnonzero(still)
    for parameter in (_WIDTH, _SLOPE)[: covariance.shape[1] - 3]:
        values, variances = fit[index, parameter], covariance[index, parameter, parameter]
        size = min(_ROWS, len(index))
        typical = median_filter(values, size=size, mode="nearest")
        low, high = np.quantile(values - typical, _QUANTILES)
        floor = (_LEAST_RELATIVE_SPREAD * np.median(typical)) ** 2 if parameter == _WIDTH else 0.0
        spread = max(((high - low) / 2.0) ** 2 - float(np.median(variances)), floor)
        # The typical value is itself an estimate from so many rows.
        spread += np.pi / 2.0 * float(np.median(variances)) / size
        prior.mean[:, parameter] = np.interp(np.arange(len(fit)), index, typical)
        prior.information[:, parameter] = 1.0 / max(spread, 1e-12)
    return prior
