"""How large the image noise is that the residuals of a stage's places show.

Residuals r over their proportions are noise σ less what six numbers of the pose take up of it; a
camera that is itself uncertain by L Lᵀ adds ``S Sᵀ``, S being what the pose leaves of L's picture.
With ``S = U s Wᵀ`` the parts ``a = Uᵀ r`` have variances ``σ² + s²``, all others σ².
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.noise import chi2_limit
from sheetoflight.calibration.self_generated_fit import SheetFit
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array

_FELT = 0.1
"""Part of the noise from which the camera's error is felt: a tenth adds a hundredth to a square."""

_ROUNDING_PX = 1e-6

_LEAST_SHARE = 1e-6
"""Share of a point's noise in its residual, up to which nothing checks the point."""


@dataclass(frozen=True)
class Noise:
    """Size of the noise.

    Parameters
    ----------
    pixel_std : float
        Standard deviation of a typical image coordinate, px.
    freedom : int or None
        Degrees of freedom from which it was estimated; None where it was stated.
    chi2_per_dof : float
        Of the stated noise; 1 where none was stated.
    warnings : tuple of str
    """

    pixel_std: float
    freedom: int | None
    chi2_per_dof: float = 1.0
    warnings: tuple[str, ...] = ()


def noise_of(fit: SheetFit, stated: float | None) -> Noise:
    """The stated noise, px, where the residuals allow it, else what they tell.

    Raises
    ------
    UntrustworthyError
        If none is stated and there are too few points, or the residuals contradict it.
    """
    ratio = 1.0
    if stated is not None:
        chi2, freedom = _against(fit, stated)
        ratio = chi2 / freedom if freedom else 1.0
        if not freedom or chi2 <= chi2_limit(freedom):
            return Noise(stated, None, ratio)
    found = estimated_noise(fit)
    if found is None:
        raise UntrustworthyError(
            "board",
            "there are too few points of known places to tell the noise from"
            if stated is None
            else f"the residuals are {np.sqrt(ratio):.1f} times as large as the stated noise",
            "give more points, or state pixel_std under [noise] in rig.toml"
            if stated is None
            else "check the points, their places, and that this is the right camera",
        )
    if stated is None:
        return found
    warning = (
        f"the residuals are {np.sqrt(ratio):.1f} times as large as the stated noise (chi-squared "
        f"per degree of freedom {ratio:.2f}); the uncertainties follow the residuals instead – "
        "look for a wrong place, a travel askew to the sheet, or another camera"
    )
    return Noise(found.pixel_std, found.freedom, ratio, (warning,))


def estimated_noise(fit: SheetFit) -> Noise | None:
    """The noise that the residuals show where the camera's error is not felt; None where that
    leaves nothing."""
    residuals, parts, size = _by_camera(fit)
    square, freedom = residuals @ residuals, len(residuals) - fit.by_pose.shape[1]
    felt = size > _FELT * np.sqrt(square / max(freedom, 1))
    freedom -= int(felt.sum())
    if freedom < 1:
        return None
    return Noise(float(np.sqrt(max(square - np.sum(parts[felt] ** 2), 0.0) / freedom)), freedom)


def _against(fit: SheetFit, stated: float) -> tuple[float, int]:
    """Chi-squared of a stated noise, and its degrees of freedom."""
    residuals, parts, size = _by_camera(fit)
    excused = parts**2 * (1.0 / stated**2 - 1.0 / (stated**2 + size**2))
    chi2 = residuals @ residuals / stated**2 - excused.sum()
    return float(chi2), len(residuals) - fit.by_pose.shape[1]


def _by_camera(fit: SheetFit) -> tuple[Array, Array, Array]:
    """Residuals ``(2P,)`` over their proportions, their parts ``a (Q,)``, and s ``(Q,)``."""
    residuals = (fit.residuals / fit.seen.std[:, None]).ravel()
    felt = fit.camera_left @ _root(fit.seen.camera_matrix)
    axes, size, _ = np.linalg.svd(felt, full_matrices=False)
    return residuals, axes.T @ residuals, size


def _root(covariance: Array) -> Array:
    """L with ``L Lᵀ`` a covariance ``(Q, Q)``, which may be singular."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(std > 0, std, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    return unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def worst_point(fit: SheetFit) -> int:
    """The point that fits least, by residuals over what noise leaves in them (W. Baarda, "A
    testing procedure for use in geodetic networks", Netherlands Geodetic Commission, 1968)."""
    residuals = (fit.residuals / fit.seen.std[:, None]).ravel()
    taken = np.einsum("ij,jk,ik->i", fit.by_pose, fit.pose_covariance, fit.by_pose)
    pull = residuals**2 / np.maximum(1.0 - taken, _LEAST_SHARE)
    return int(np.argmax(pull.reshape(-1, 2).sum(axis=1)))


def odds_of_drop(every: Noise, rest: Noise, count: int) -> float:
    """Odds, at most, that leaving out the worst of so many points lowers the noise so much.

    ``F = [(ν s² − ν' s'²) / (ν − ν')] / s'²``, times the number of points that might be the worst.
    """
    if every.freedom is None or rest.freedom is None or every.freedom <= rest.freedom:
        return 1.0
    lost = every.freedom - rest.freedom
    drop = every.freedom * every.pixel_std**2 - rest.freedom * rest.pixel_std**2
    if drop <= _ROUNDING_PX**2:
        return 1.0
    F = drop / lost / max(rest.pixel_std, _ROUNDING_PX) ** 2
    return min(1.0, count * float(fdtrc(lost, rest.freedom, F)))
