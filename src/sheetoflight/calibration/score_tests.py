"""A fit made ready for hypotheses: how much chi-squared would fall if a fault were estimated.

Rao's score test: with ``g`` and ``S`` the gradient and the information of a fault's parameters,
all others eliminated, chi-squared would fall by ``gᵀ S⁻¹ g``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.estimation.variance_components import Contrasts
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class ScoredFit:
    """The fit, ready for hypotheses."""

    stages: tuple[str, ...]
    groups: Sequence[Contrasts]
    inverses: Sequence[Array]
    covariance: Array
    chi2: dict[str, float]
    freedom: dict[str, float]
    adjustment: Adjustment
    state: RigState
    sizes: Array

    @classmethod
    def of(cls, fit: Fit) -> ScoredFit:
        """Ready a fit of all stages.

        Raises
        ------
        numpy.linalg.LinAlgError
            If its shared parameters are undetermined.
        """
        groups, covariance = fit.contrasts, fit.covariance
        inverses = [np.linalg.inv(group.covariance(fit.noise.variances)) for group in groups]
        chi2, freedom = {}, {}
        for (stage, views), group, inverse in zip(
            fit.adjustment.stages.items(), groups, inverses, strict=False
        ):
            chi2[stage] = float(np.einsum("ni,nij,nj->", group.values, inverse, group.values))
            own = covariance[np.ix_(group.columns, group.columns)]
            pull = np.swapaxes(group.by_shared, 1, 2) @ inverse @ group.by_shared
            observed = 2 * int(views.seen.sum()) - LOCAL_SIZE[stage] * len(views)
            freedom[stage] = observed - float(np.sum(own * pull.sum(axis=0)))
        return cls(
            tuple(fit.adjustment.stages),
            groups,
            inverses,
            covariance,
            chi2,
            freedom,
            fit.adjustment,
            fit.state,
            np.maximum(fit.noise.variances, 0.0),
        )

    def gain(self, columns: Mapping[str, Array]) -> float:
        """What estimating a fault is worth: how far Schwarz's criterion falls.

        Parameters
        ----------
        columns : mapping from stage to (N, 2M, q) array
            How the image points would move with the fault's q parameters, px per unit.
        """
        before, observed = sum(self.chi2.values()), sum(self.freedom.values())
        count = next(iter(columns.values())).shape[-1]
        after = max(before - self.fall(columns), 1e-12 * before)
        return float(observed * np.log(before / after) - count * np.log(observed))

    def fall(self, columns: Mapping[str, Array]) -> float:
        """How much chi-squared would fall if a fault were estimated."""
        terms = [self._terms(stage, moves) for stage, moves in columns.items()]
        sums = (np.sum([part.sum(axis=0) for part in parts], axis=0, keepdims=True)
                for parts in zip(*terms, strict=True))  # fmt: skip
        return float(self._falls(*sums)[0])

    def first_after_change(self, stage: str, moves: Array, views: np.ndarray, few: int) -> int:
        """From which of the views on, in their order, moves of the points explain most.

        Parameters
        ----------
        stage : str
        moves : (N, 2M, q) array
            How the image points would move, px per unit.
        views : (V,) int array
            Those among which the change is sought, at least ``2 few``.
        few : int
            Least number of views on either side.

        Returns
        -------
        int
            Place in `views`.
        """
        after = (
            np.cumsum(part[views[::-1]], axis=0)[::-1][few : len(views) - few + 1]
            for part in self._terms(stage, moves)
        )
        return few + int(self._falls(*after).argmax())

    def _terms(self, stage: str, moves: Array) -> tuple[Array, Array, Array]:
        """Each view's gradient ``(N, q)`` by moves of its points, their information
        ``(N, q, q)``, and that on them and the shared parameters ``(N, q, P)``."""
        place = self.stages.index(stage)
        group, inverse = self.groups[place], self.inverses[place]
        moved = group.across @ moves
        pull = np.swapaxes(moved, 1, 2) @ inverse
        mixed = np.zeros((*pull.shape[:2], len(self.covariance)))
        mixed[..., group.columns] = pull @ group.by_shared
        return (pull @ group.values[..., None])[..., 0], pull @ moved, mixed

    def _falls(self, gradient: Array, own: Array, mixed: Array) -> Array:
        """``gᵀ S⁻¹ g`` of K hypotheses from the sums of their views' terms."""
        left = own - mixed @ self.covariance @ np.swapaxes(mixed, 1, 2)
        scale = 1.0 / np.sqrt(np.maximum(np.einsum("kqq->kq", own), 1e-300))
        scaled = left * scale[:, :, None] * scale[:, None, :]
        inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True)
        return np.einsum("kp,kpq,kq->k", gradient * scale, inverse, gradient * scale)

    def widest(self, fit: Fit) -> list[Contrasts]:
        """The same contrasts with all noise components that are estimated."""
        return fit.noise.contrasts(self.adjustment, self.state, {})

    def explained(self, groups: Sequence[Contrasts], estimate: Array) -> float:
        """Share of the residuals' squares that estimated parameters take away."""
        before = sum(self.chi2.values())
        after = 0.0
        # the boards come last; no hypothesis is about them
        for group, inverse in zip(groups, self.inverses, strict=True):
            values = group.values + group.by_shared @ estimate[group.columns]
            after += float(np.einsum("ni,nij,nj->", values, inverse, values))
        return min(max(1.0 - after / before, 0.0), 1.0)
