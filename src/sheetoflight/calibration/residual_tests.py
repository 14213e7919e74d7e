"""Which residuals are too large to be noise.

A marker that was detected wrongly, or a view that is wrong as a whole, is a shift of image points
that the model does not know. Rao's score test tells how much chi-squared would fall if the shift
were estimated, without estimating it: with the contrasts y of a view, their covariance V, their
derivatives X by the shared parameters, whose covariance is C, and the columns Z of the shift,

    fall = gᵀ S⁻¹ g,    g = Zᵀ V⁻¹ y,    S = Zᵀ (V⁻¹ − V⁻¹ X C Xᵀ V⁻¹) Z,

which is chi-squared distributed with the rank of S. For one shift it is Baarda's test (*A testing
procedure for use in geodetic networks*, 1968).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.fit import Fit
from sheetoflight.geometry.directions import Array

_ROUNDING_PX = 1e-6

_RANK = 1e-6
"""Part of the greatest eigenvalue below which a shift is not seen at all."""

QUIET_SHARE = 0.35
"""Quantile of the views' chi-squared by which the noise is judged: with a fifth of three markers
wrong, half of the views are touched."""


@dataclass(frozen=True)
class StageTests:
    """Tests of one stage's views.

    Parameters
    ----------
    marker : (N, M) array
        Fall of chi-squared if the marker's image were free; 0 where it was not seen or its shift
        cannot be told.
    view : (N,) array
        Chi-squared of the view's contrasts.
    freedom : (N,) array
        Number of its contrasts.
    """

    marker: Array
    view: Array
    freedom: Array


def residual_tests(fit: Fit) -> dict[str, StageTests]:
    """Tests of all markers and views of a fit, by stage, in units of its noise.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the shared parameters are undetermined.
    """
    adjustment, sizes = fit.adjustment, fit.noise.variances
    covariance = fit.covariance if adjustment.shared_size else None
    found = {}
    # the boards, which come last, are judged by themselves (board_screening)
    for (stage, views), group in zip(adjustment.stages.items(), fit.contrasts, strict=False):
        inverse = np.linalg.inv(group.covariance(sizes))
        weighted = inverse @ group.values[..., None]
        chi2 = np.sum(group.values[..., None] * weighted, axis=(1, 2))
        left = inverse
        if covariance is not None:
            pull = inverse @ group.by_shared
            own = covariance[np.ix_(group.columns, group.columns)]
            left = inverse - pull @ own @ np.swapaxes(pull, 1, 2)
        count, markers = views.uv.shape[:2]
        turned = np.swapaxes(group.across, 1, 2)
        gradient = (turned @ weighted).reshape(count, markers, 2)
        shifts = turned.reshape(count, markers, 2, -1)
        strength = shifts @ left[:, None] @ np.swapaxes(shifts, 2, 3)
        fall = np.where(views.seen, _fall(gradient, strength), 0.0)
        local = group.across.shape[2] - group.across.shape[1]
        freedom = np.maximum(2 * views.seen.sum(axis=1) - local, 0)
        found[stage] = StageTests(fall, chi2, freedom.astype(float))
    return found


def _fall(gradient: Array, strength: Array) -> Array:
    """``gᵀ S⁺ g`` of 2 x 2 systems ``(N, M)``."""
    values, vectors = np.linalg.eigh(strength)
    along = np.einsum("nmab,nma->nmb", vectors, gradient)
    top = np.maximum(values[..., -1:], 1e-300)
    kept = values > _RANK * top
    return np.sum(np.where(kept, along**2 / np.where(kept, values, 1.0), 0.0), axis=-1)


def exact(fit: Fit) -> bool:
    """Whether the residuals are no more than rounding: points without noise tell nothing."""
    residuals = fit.adjustment.residuals_px(fit.state).values()
    return all(np.nanmax(np.abs(part), initial=0.0) < _ROUNDING_PX for part in residuals)


def quiet_variance(tests: dict[str, StageTests]) -> float:
    """Variance factor of the noise by the quieter views, which a fifth of wrong markers leaves
    as they are; near 1 where all is as modelled."""
    ratios = [
        test.view[test.freedom > 0] / _quiet_quantile(test.freedom[test.freedom > 0])
        for test in tests.values()
    ]
    every = np.concatenate(ratios) if ratios else np.zeros(0)
    return float(np.quantile(every, QUIET_SHARE)) if every.size else 1.0


def _quiet_quantile(freedom: Array) -> Array:
    return np.asarray(chdtri(freedom, 1.0 - QUIET_SHARE))
