"""Whether two independent calibrations of one rig agree within their uncertainties.

Their differences have the sum of both covariances, but for a camera that was known before and
held in both. A sheet's normal has two degrees of freedom: differences of normals are taken in the
plane across their mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.measurement.triangulation import parameter_names, triangulate_with_jacobians
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import PLANE_PARTS, Covariance
from sheetoflight.model.second_opinion import Agreement, ScaleDifference, SheetAgreement

_ROUNDING = 1e-9
"""How exactly an adjustment is solved, as a share of a parameter, or of 1 where it is smaller."""


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences of what two calibrations both determine.

    Normal and distance of a curved sheet are those amid the points that it was found from: they
    are not compared, only points in it are (`sheet_agreement`).

    Parameters
    ----------
    first, second : Calibration
    camera_known : bool
        Whether both hold one camera that was known before, with its uncertainty.
    """

    first: Calibration
    second: Calibration
    camera_known: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that both estimated, of flat sheets and of the camera."""
        both = self.second.covariance.parameters
        return tuple(
            name
            for name in self.first.covariance.parameters
            if name in both
            and name.rpartition(".")[0] not in self._curved
            and not (self.camera_known and name.startswith("camera."))
        )

    @property
    def lasers(self) -> tuple[str, ...]:
        """Lasers whose flat sheets both determine."""
        return tuple(name for name in self.sheets if name not in self._curved)

    @property
    def sheets(self) -> tuple[str, ...]:
        """Lasers whose sheets both determine, flat or curved."""
        one, other = self.first.covariance.parameters, self.second.covariance.parameters
        return tuple(n for n in self.first.lasers if f"{n}.d" in one and f"{n}.d" in other)

    @property
    def _curved(self) -> set[str]:
        every = (*self.first.light_planes, *self.second.light_planes)
        return {plane.name for plane in every if plane.curvature is not None}

    @property
    def values(self) -> Array:
        """``(P,)`` second less first, in the order of `names`."""
        one, other = _values(self.first), _values(self.second)
        return np.array([other[name] - one[name] for name in self.names])

    def covariance(self, names: tuple[str, ...]) -> Array:
        """Covariance ``(P, P)`` of the differences of parameters."""
        whole = self.first.covariance.block(names) + self.second.covariance.block(names)
        if self.camera_known:
            shared = self.shared(names, names)
            whole = whole - shared - shared.T
        values = _values(self.first)
        exactness = [_ROUNDING * max(abs(values[name]), 1.0) for name in names]
        return whole + np.diag(np.square(exactness))

    def shared(self, first: tuple[str, ...], second: tuple[str, ...]) -> Array:
        """Covariance ``(P, Q)`` of parameters of the first with those of the second.

        With a known camera of covariance K both follow it: ``Cov(x1, x2) = C1 K⁺ C2``, of the
        columns and rows of the camera.
        """
        one, other = self.first.covariance, self.second.covariance
        held = tuple(n for n in one.parameters if n.startswith("camera."))
        left = one.block((*first, *held))[: len(first), len(first) :]
        right = other.block((*second, *held))[len(second) :, : len(second)]
        return left @ np.linalg.pinv(one.block(held), hermitian=True) @ right

    def independent(self) -> Array:
        """``(Q, P)``: from the parameters to as many coordinates as may differ."""
        names = self.names
        rows = [_unit(names.index(n), len(names)) for n in names if n.startswith("camera.")]
        for laser in self.lasers:
            columns = [names.index(f"{laser}.{part}") for part in PLANE_PARTS]
            middle = self.first.sheet(laser).normal + self.second.sheet(laser).normal
            for tangent in tangent_basis(normalised(middle)):
                row = np.zeros(len(names))
                row[columns[:3]] = tangent
                rows.append(row)
            rows.append(_unit(columns[3], len(names)))
        return np.array(rows).reshape(len(rows), len(names))


@dataclass(frozen=True, eq=False)
class ChiSquared:
    """The differences against their covariance, in one number.

    Parameters
    ----------
    value : float
    size : int
        Number of independent differences.
    freedom : float
        Effective degrees of freedom of the noise.
    """

    value: float
    size: int
    freedom: float

    @property
    def odds(self) -> float:
        """Of as large a value by chance: Fisher's F where the noise was estimated."""
        if self.size < 1:
            return 1.0
        if math.isinf(self.freedom):
            return float(chdtrc(self.size, self.value))
        return float(fdtrc(self.size, self.freedom, self.value / self.size))


def agreements(found: Differences) -> tuple[Agreement, ...]:
    """Every parameter that both determine."""
    one, other = _values(found.first), _values(found.second)
    std = np.sqrt(np.maximum(np.diag(found.covariance(found.names)), 0.0))
    return tuple(
        Agreement(name, one[name], other[name], float(s))
        for name, s in zip(found.names, std, strict=True)
    )


def chi_squared(found: Differences) -> ChiSquared:
    """``yᵀ S⁻¹ y`` of the independent differences y with covariance S."""
    change = found.independent()
    if not len(change):
        return ChiSquared(0.0, 0, math.inf)
    whitening = _whitening(change @ found.covariance(found.names) @ change.T) @ change
    value = float(np.sum((whitening @ found.values) ** 2))
    return ChiSquared(value, len(change), _freedom(found, whitening))


def scale_difference(found: Differences) -> ScaleDifference | None:
    """By how much the second calibration's lengths are longer, all by one factor.

    The factor multiplies the distances of the sheets and moves nothing else. With
    ``a = ∂y/∂s``: ``s = aᵀS⁻¹y / aᵀS⁻¹a``. None where no sheet is determined by both, or where
    they differ too much for any factor to tell.
    """
    if not found.lasers:
        return None
    change = found.independent()
    whitening = _whitening(change @ found.covariance(found.names) @ change.T) @ change
    by_scale = np.zeros(len(found.names))
    for laser in found.lasers:
        by_scale[found.names.index(f"{laser}.d")] = found.first.sheet(laser).distance_mm
    along, white = whitening @ by_scale, whitening @ found.values
    weight = float(along @ along)
    relative = float(along @ white) / weight
    if relative <= -1.0:
        return None
    unit = (along / math.sqrt(weight))[None, :]
    own = ChiSquared(relative**2 * weight, 1, _freedom(found, unit @ whitening))
    rest = float(np.sum((white - relative * along) ** 2))
    others = ChiSquared(rest, len(white) - 1, _freedom(found, whitening))
    return ScaleDifference(relative, 1.0 / math.sqrt(weight), own.odds, others.odds)


def sheet_agreement(found: Differences, uv: Array, laser: str) -> SheetAgreement | None:
    """The same pixels ``(N, 2)`` by both, mm; None where none meets both sheets."""
    one = triangulate_with_jacobians(found.first, uv, laser)
    other = triangulate_with_jacobians(found.second, uv, laser)
    seen = np.isfinite(one.xyz).all(axis=1) & np.isfinite(other.xyz).all(axis=1)
    if not seen.any():
        return None
    apart = np.linalg.norm(other.xyz - one.xyz, axis=1)[seen]
    variances = _point_variances(found, laser, one.by_parameter[seen], other.by_parameter[seen])
    depths = one.xyz[seen, 2]
    return SheetAgreement(
        laser=laser,
        points=int(seen.sum()),
        nearest_mm=float(depths.min()),
        farthest_mm=float(depths.max()),
        rms_mm=float(np.sqrt(np.mean(apart**2))),
        largest_mm=float(apart.max()),
        std_mm=float(np.sqrt(np.mean(np.maximum(variances, 0.0)))),
    )


def _point_variances(found: Differences, laser: str, one: Array, other: Array) -> Array:
    """Variances ``(N,)`` of the differences of points by either, all coordinates together, mm².

    ``one`` and ``other`` are their derivatives ``(N, 3, P)`` by camera and sheet. A curved sheet
    has more parameters than a flat one, so that each side goes with its own covariance.
    """
    names = parameter_names(found.first.sheet(laser)), parameter_names(found.second.sheet(laser))
    total = np.zeros(len(one))
    for slope, calibration, own in zip(
        (one, other), (found.first, found.second), names, strict=True
    ):
        block = calibration.covariance.block(own)
        total += np.einsum("nij,jk,nik->n", slope, block, slope)
    if found.camera_known:
        shared = found.shared(*names)
        total -= 2.0 * np.einsum("nij,jk,nik->n", one, shared, other)
    return total


def _freedom(found: Differences, whitening: Array) -> float:
    """Effective degrees of freedom of whitened differences ``W x``, W ``(Q, P)``.

    Satterthwaite's formula (`NoiseComponents.degrees_of_freedom`) for the sum of their variances,
    Q: exact where one component of one calibration brings all of it, and Welch's for Q = 1.
    """
    names, size = found.names, float(len(whitening))
    inverse = 0.0
    for covariance in (found.first.covariance, found.second.covariance):
        shares = _shares(covariance, names, whitening)
        inverse += 1.0 / covariance.components.degrees_of_freedom(size, shares)
    return 1.0 / inverse if inverse > 0 else math.inf


def _shares(covariance: Covariance, names: tuple[str, ...], whitening: Array) -> dict[str, float]:
    """What each noise component brings to the sum of variances."""
    shares: dict[str, float] = {}
    for source in covariance.sources:
        if source.component is not None:
            part = whitening @ covariance.block(names, source.matrix) @ whitening.T
            shares[source.component] = shares.get(source.component, 0.0) + float(np.trace(part))
    return shares


def _whitening(covariance: Array) -> Array:
    """W with ``W S Wᵀ = I``, scaled first: pixels and distortions differ by many powers of ten."""
    std = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(std, std))
    return np.linalg.solve(root, np.diag(1.0 / std))


def _values(calibration: Calibration) -> dict[str, float]:
    camera = calibration.camera
    values = {
        f"camera.{name}": float(value)
        for name, value in zip(camera.PARAMETERS, camera.parameters, strict=True)
    }
    for plane in calibration.light_planes:
        values |= plane.parameters
    return values


def _unit(place: int, size: int) -> Array:
    row = np.zeros(size)
    row[place] = 1.0
    return row
