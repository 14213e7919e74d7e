"""What errors of several lengths have in common: bias, scale, and whether their stated
uncertainties explain them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc

from sheetoflight.geometry.directions import Array

SIGNIFICANT = 0.01
"""A finding is told where chance alone would bring it in one of a hundred cases."""

_APART = 1.5
"""Longest over shortest length from which a scale error is told from a constant one."""

_SINGULAR = 1e-10


@dataclass(frozen=True)
class Estimate:
    """A number with its standard uncertainty."""

    value: float
    std: float

    @property
    def p_value(self) -> float | None:
        """Odds of being at least as far from zero where the truth is zero; None where the
        uncertainty is zero."""
        if not self.std > 0:
            return None
        return math.erfc(abs(self.value) / self.std / math.sqrt(2.0))

    @property
    def significant(self) -> bool:
        """Whether it differs from zero by more than its uncertainty explains."""
        return self.p_value is not None and self.p_value < SIGNIFICANT


@dataclass(frozen=True)
class ErrorStatistics:
    """Errors of N lengths summed up, mm.

    Parameters
    ----------
    number : int
    mean : Estimate
        The bias; its uncertainty holds what the errors share.
    spread : float, optional
        Sample standard deviation; None for a single error.
    rms, largest : float
        Root mean square, and largest absolute error.
    scale : Estimate
        Growth of the error with the length, mm per m.
    offset : Estimate, optional
        Error of a length of zero; None where the lengths are too alike to tell, and `scale` then
        takes it as zero.
    chi2, chi2_p : float, optional
        Sum of squares of the errors after whitening by their stated covariance, and the odds of
        one as large or larger where that holds; None where the covariance is singular.
    disagreement : tuple of float
        How far each error lies from what the others let expect of it, in standard deviations:
        ``(V⁻¹ e)ᵢ / √(V⁻¹)ᵢᵢ`` (Baarda's test, Netherlands Geodetic Commission 2(5), 1968);
        empty where the covariance is singular.
    """

    number: int
    mean: Estimate
    spread: float | None
    rms: float
    largest: float
    scale: Estimate
    offset: Estimate | None
    chi2: float | None
    chi2_p: float | None
    disagreement: tuple[float, ...] = ()

    @property
    def odd_one(self) -> int | None:
        """The error that least agrees with the others, where that is more than chance."""
        if self.number < 3 or not self.disagreement:
            return None
        worst = int(np.argmax(np.abs(self.disagreement)))
        odds = Estimate(self.disagreement[worst], 1.0).p_value or 0.0
        return worst if self.number * odds < SIGNIFICANT else None

    @property
    def findings(self) -> tuple[str, ...]:
        """What stands out, in sentences."""
        return (*self._of_shape(), *self._of_size())

    def _of_shape(self) -> list[str]:
        told = []
        if self.offset is None:
            if self.mean.significant:
                told.append(
                    f"Lengths come out {_told(self.mean, 'mm')} off on average, or "
                    f"{self.scale.value:+.3g} mm/m. The known lengths are too alike to tell a "
                    "scale error from a constant one: add shorter or longer ones."
                )
            return told
        if self.scale.significant:
            told.append(
                f"Errors grow with the length by {_told(self.scale, 'mm/m')}: a scale error. Check "
                "the distances of the target's markers, and the known lengths."
            )
        if self.offset.significant:
            told.append(
                f"All lengths share a constant error of {_told(self.offset, 'mm')}. Check how the "
                "ends of the line are found, and what the known lengths run between."
            )
        if self.mean.significant and not told:
            told.append(
                f"Lengths come out {_told(self.mean, 'mm')} off on average, more than the stated "
                "uncertainties explain."
            )
        return told

    def _of_size(self) -> list[str]:
        if self.chi2 is None or self.chi2_p is None:
            return []
        size = f"(χ² = {self.chi2:.3g} for {self.number} lengths)"
        if self.chi2_p < SIGNIFICANT:
            return [f"Errors are larger than the stated uncertainties explain {size}."]
        if self.chi2_p > 1.0 - SIGNIFICANT:
            return [
                f"Errors are smaller than the stated uncertainties would have them {size}: these "
                "are cautious, or the known lengths come from this very rig."
            ]
        return []


def error_statistics(errors: Array, lengths: Array, covariance: Array) -> ErrorStatistics:
    """Sum up errors of lengths.

    Mean, offset and scale are least-squares estimates with equal weights: their uncertainty comes
    from the covariance, their value does not, so that a wrong covariance bends no finding.

    Parameters
    ----------
    errors : (N,) array
        Measured minus known, mm; at least one.
    lengths : (N,) array
        Known lengths, mm.
    covariance : (N, N) array
        Stated covariance of the errors, mm².
    """
    number = len(errors)
    (mean,) = _fitted(np.ones((number, 1)), errors, covariance)
    metres = lengths / 1000.0
    offset = None
    if number >= 3 and lengths.max() >= _APART * lengths.min():
        offset, scale = _fitted(np.stack([np.ones(number), metres], axis=1), errors, covariance)
    else:
        (scale,) = _fitted(metres[:, None], errors, covariance)
    weights = _weights(covariance)
    chi2 = None if weights is None else float(errors @ weights @ errors)
    disagreement = () if weights is None else _disagreement(errors, weights)
    return ErrorStatistics(
        number=number,
        mean=mean,
        spread=float(np.std(errors, ddof=1)) if number > 1 else None,
        rms=float(np.sqrt(np.mean(errors**2))),
        largest=float(np.abs(errors).max()),
        scale=scale,
        offset=offset,
        chi2=chi2,
        chi2_p=None if chi2 is None else float(gammaincc(number / 2.0, chi2 / 2.0)),
        disagreement=disagreement,
    )


def _fitted(design: Array, errors: Array, covariance: Array) -> list[Estimate]:
    """Least squares with equal weights, and the true uncertainty of its coefficients."""
    solve = np.linalg.pinv(design)
    spread = np.einsum("ki,ij,kj->k", solve, covariance, solve)
    return [
        Estimate(float(value), math.sqrt(max(float(variance), 0.0)))
        for value, variance in zip(solve @ errors, spread, strict=True)
    ]


def _weights(covariance: Array) -> Array | None:
    """``V⁻¹``; None where V does not vary in all directions."""
    std = np.sqrt(np.diag(covariance))
    if not (std > 0).all():
        return None
    values, directions = np.linalg.eigh(covariance / np.outer(std, std))
    if values[0] < _SINGULAR * values[-1]:
        return None
    return (directions / values) @ directions.T / np.outer(std, std)


def _disagreement(errors: Array, weights: Array) -> tuple[float, ...]:
    return tuple((weights @ errors / np.sqrt(np.diag(weights))).tolist())


def _told(estimate: Estimate, unit: str) -> str:
    return f"{estimate.value:+.3g} {unit} (standard uncertainty {estimate.std:.2g})"
