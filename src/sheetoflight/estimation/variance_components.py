"""How large the noise is, where it has several sources: restricted maximum likelihood.

The residuals of many small groups share some parameters and have covariance
``V = Σ θ_k V_k``. Each group's own parameters are eliminated by contrasts, combinations
of its residuals that they do not move; what is left is a linear model of the shared parameters
alone, whose residual likelihood gives the θ_k without the bias that ignoring the estimated
parameters would bring: H. D. Patterson and R. Thompson, Biometrika 58(3), 1971. The iteration is
Fisher scoring, with θ_k ≥ 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.geometry.directions import Array

_ITERATIONS = 60
_TOLERANCE = 1e-6
"""Length of the last step, in standard uncertainties of the variances."""

_LARGEST_FALL = 0.02
"""No variance falls to less than this part of itself in one step: the next score may be wrong."""

_LEAST = 1e-12
"""No variance falls to less than this part of its start: residuals of exact points have none."""

_VANISHED = 1e-7
"""A variance that explains less than this part of the residuals' is none."""


@dataclass(frozen=True)
class Contrasts:
    """N alike groups, their own parameters eliminated.

    Parameters
    ----------
    values : (N, m) array
        Residuals.
    by_shared : (N, m, s) array
    columns : (s,) int array
        Which of all shared parameters those are.
    unseen : (N, m, m) array
        Projector on combinations of residuals that were not observed.
    variances : tuple of (int, (N, m, m) array)
        The component and its V_k.
    across : (N, m, r) array
        From a group's r residuals to its m contrasts.
    rest : tuple of (int, float, int)
        Residuals that no parameter moves, of which only the component, the sum of squares and
        the number are kept. Each is disturbed by that component alone.
    """

    values: Array
    by_shared: Array
    columns: np.ndarray
    unseen: Array
    variances: tuple[tuple[int, Array], ...]
    across: Array
    rest: tuple[tuple[int, float, int], ...] = ()

    def covariance(self, sizes: Array) -> Array:
        """V ``(N, m, m)`` for component variances θ. What was not observed gets a variance of
        the others' size: it is 0 and moves with nothing, so that any will do."""
        observed = sum(sizes[k] * part for k, part in self.variances)
        return observed + float(np.max(observed, initial=0.0)) * self.unseen

    def widened(self, own: Array | None, first: int, count: int) -> Contrasts:
        """With further parameters.

        Parameters
        ----------
        own : (N, r, count) array, optional
            Derivatives of the groups' residuals by them; absent where they move nothing.
        first : int
            Number of the first of them among all shared parameters.
        count : int
        """
        if own is None:
            return self
        columns = np.concatenate([self.columns, np.arange(first, first + count)])
        by_shared = np.concatenate([self.by_shared, self.across @ own], axis=2)
        return replace(self, by_shared=by_shared, columns=columns)


def contrasts(
    block: Block,
    variances: Sequence[tuple[int, Array]],
    seen: np.ndarray,
    rest: tuple[tuple[int, float, int], ...] = (),
) -> Contrasts:
    """Eliminate the groups' own parameters.

    Parameters
    ----------
    block : Block
        Residuals in their own unit, neither weighted nor whitened; 0 where nothing was observed.
    variances : sequence of (int, (N, r, r) array)
        Components and their V_k.
    seen : (N, r) mask
        Residuals that were observed.
    rest : tuple of (int, float, int)
        See `Contrasts`.
    """
    local = block.by_local.shape[-1]
    basis = np.linalg.qr(block.by_local, mode="complete")[0][..., local:]
    across = np.swapaxes(basis, 1, 2)
    return Contrasts(
        values=(across @ block.residuals[..., None])[..., 0],
        by_shared=across @ block.by_shared,
        columns=block.columns,
        unseen=across @ (np.where(seen, 0.0, 1.0)[..., None] * basis),
        variances=tuple((k, across @ part @ basis) for k, part in variances),
        across=across,
        rest=rest,
    )


def compressed(design: Array, residuals: Array) -> tuple[Array, Array, Array]:
    """Residuals ``e = J x`` of many observations of unit variance turned so that few of them hold
    all that J sees.

    With ``[J e] = Q R``, the rows of R say the same as those of ``[J e]``, and the last element
    is the length of what J cannot reach.

    Parameters
    ----------
    design : (N, n, k) array
    residuals : (N, n) array

    Returns
    -------
    design : (N, q, k), residuals : (N, q), with q the lesser of n and k
    rest : (N,)
        Sum of squares of the ``n − q`` others.
    """
    whole = np.concatenate([design, residuals[..., None]], axis=2)
    triangle = np.asarray(np.linalg.qr(whole, mode="r"))
    width = design.shape[2]
    kept = triangle[:, :width]
    rest = triangle[:, width, width] ** 2 if triangle.shape[1] > width else np.zeros(len(design))
    return kept[..., :width], kept[..., width], rest


@dataclass(frozen=True)
class ReducedModel:
    """The linear model of the shared parameters for given component variances.

    Parameters
    ----------
    information : (P, P) array
        ``Σ Xᵀ V⁻¹ X``.
    gradient : (P,) array
        ``Σ Xᵀ V⁻¹ y``.
    shares : mapping from (block, component) to (P, P) array
        ``Σ Xᵀ V⁻¹ V_k V⁻¹ X``: what the component's noise in that block does to the gradient.
    """

    information: Array
    gradient: Array
    shares: dict[tuple[int, int], Array]


def reduced_model(groups: Sequence[Contrasts], size: int, sizes: Array) -> ReducedModel:
    """What the contrasts say of the shared parameters.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is not positive definite.
    """
    return _model([_Whitened.of(group, sizes) for group in groups], size)


@dataclass(frozen=True)
class _Whitened:
    """Groups in units of their noise, ``V = I``, one below the other."""

    columns: np.ndarray
    values: Array  # (N m,)
    by_shared: Array  # (N m, s)
    variances: Mapping[int, Array]  # V_k, (N, m, m)
    pulled: Mapping[int, Array]  # V_k X, (N m, s)
    rest: tuple[tuple[int, float, int], ...]

    @classmethod
    def of(cls, group: Contrasts, sizes: Array) -> _Whitened:
        whitener = np.linalg.inv(np.linalg.cholesky(group.covariance(sizes)))
        turned = np.swapaxes(whitener, 1, 2)
        by_shared = whitener @ group.by_shared
        width = by_shared.shape[2]
        variances = {k: whitener @ part @ turned for k, part in group.variances}
        return cls(
            group.columns,
            (whitener @ group.values[..., None]).ravel(),
            by_shared.reshape(-1, width),
            variances,
            {k: (part @ by_shared).reshape(-1, width) for k, part in variances.items()},
            group.rest,
        )


def _model(groups: Sequence[_Whitened], size: int) -> ReducedModel:
    information, gradient = np.zeros((size, size)), np.zeros(size)
    shares = {}
    for place, group in enumerate(groups):
        at = np.ix_(group.columns, group.columns)
        information[at] += group.by_shared.T @ group.by_shared
        gradient[group.columns] += group.by_shared.T @ group.values
        for k, pulled in group.pulled.items():
            shares[place, k] = np.zeros((size, size))
            shares[place, k][at] = group.by_shared.T @ pulled
    return ReducedModel(information, gradient, shares)


@dataclass(frozen=True)
class VarianceComponents:
    """Estimated component variances.

    Parameters
    ----------
    sizes : (K,) array
        θ, 0 where a component explains nothing.
    covariance : (K, K) array
        Of the estimates; zero rows for components that were held or vanished.
    converged : bool
    score : (K,) array
        Twice the slope of the likelihood where the last step began, of all components.
    fisher : (K, K) array
        Twice the information on them there.
    """

    sizes: Array
    covariance: Array
    converged: bool
    score: Array
    fisher: Array


def variance_components(
    groups: Sequence[Contrasts],
    size: int,
    start: Array,
    free: np.ndarray,
    tolerance: float = _TOLERANCE,
) -> VarianceComponents:
    """Restricted maximum likelihood of the component variances.

    Parameters
    ----------
    groups : sequence of Contrasts
    size : int
        Number of shared parameters.
    start : (K,) array
        First variances, above zero where free.
    free : (K,) mask
        Components to estimate; the others keep their start.
    tolerance : float
        Length of the last step, in standard uncertainties of the variances.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the shared parameters are undetermined.
    """
    sizes, active, converged = start.astype(float), free.copy(), not free.any()
    score, fisher, scale = _score(groups, size, sizes)
    for _ in range(_ITERATIONS if free.any() else 0):
        # a variance that has fallen to nothing comes back only if the likelihood asks for it
        active = free & ((sizes > 0) | (score > 0))
        if not active.any():
            converged = True
            break
        step = np.zeros_like(sizes)
        step[active] = _pseudo_inverse(fisher[np.ix_(active, active)]) @ score[active]
        least = np.maximum(_LARGEST_FALL * sizes, _LEAST * start)
        proposed = np.where(sizes > 0, np.maximum(sizes + step, least), 0.0)
        proposed = np.where(active & (sizes == 0), np.maximum(step, 0.0), proposed)
        proposed = np.where(active & (proposed * scale < _VANISHED), 0.0, proposed)
        proposed = np.where(free, proposed, sizes)
        change = proposed - sizes
        sizes = proposed
        if 0.5 * change @ fisher @ change <= tolerance**2:
            converged = True
            break
        score, fisher, scale = _score(groups, size, sizes)
    covariance = np.zeros_like(fisher)
    known = free & (sizes > 0)
    if known.any():
        covariance[np.ix_(known, known)] = 2.0 * _pseudo_inverse(fisher[np.ix_(known, known)])
    return VarianceComponents(sizes, covariance, bool(converged), score, fisher)


def _pseudo_inverse(fisher: Array) -> Array:
    """Inverse on the scale of correlations; components that cannot be told apart share."""
    diagonal = np.diag(fisher)
    scale = np.where(diagonal > 0, 1.0, 0.0) / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    inverse = np.linalg.pinv(fisher * scale[:, None] * scale, rcond=1e-8, hermitian=True)
    return inverse * scale[:, None] * scale


def excess(found: VarianceComponents, free: np.ndarray) -> Array:
    """How strongly the residuals ask for more of each component, in standard deviations.

    Rao's score test of the null hypothesis that the sizes are right, each component by itself,
    with the ``free`` ones that are above zero estimated beside it.

    Returns
    -------
    (K,) array
        About standard normal under the null hypothesis; 0 for components that act nowhere.
    """
    sizes, score, fisher = found.sizes, found.score, found.fisher
    beside = np.flatnonzero(free & (sizes > 0))
    result = np.zeros(len(sizes))
    for k in range(len(sizes)):
        others = beside[beside != k]
        rest, own = score[k], fisher[k, k]
        if others.size:
            slope = np.linalg.solve(fisher[np.ix_(others, others)], fisher[others, k])
            rest, own = rest - slope @ score[others], own - slope @ fisher[others, k]
        if own > _VANISHED * fisher[k, k]:
            result[k] = rest / np.sqrt(2.0 * own)
    return result


def _score(groups: Sequence[Contrasts], size: int, sizes: Array) -> tuple[Array, Array, Array]:
    """Twice the score ``yᵀ P V_k P y − tr(P V_k)``, twice the Fisher information
    ``tr(P V_k P V_l)``, and each component's share of the residuals' variance per unit."""
    whitened = [_Whitened.of(group, sizes) for group in groups]
    model = _model(whitened, size)
    covariance = np.linalg.inv(model.information)
    shift = covariance @ model.gradient
    count = len(sizes)
    score, scale = np.zeros(count), np.zeros(count)
    fisher = np.zeros((count, count))
    mixed = np.zeros((count, size, size))
    for place, group in enumerate(whitened):
        rest = group.values - group.by_shared @ shift[group.columns]
        own = covariance[np.ix_(group.columns, group.columns)]
        for k, part in group.variances.items():
            views = rest.reshape(*part.shape[:2], 1)
            trace = float(np.einsum("nii->", part))
            score[k] += np.vdot(views, part @ views) - trace
            scale[k] = max(scale[k], trace / rest.size)
            mixed[k] += model.shares[place, k]
            for other, beside in group.variances.items():
                between = group.pulled[k].T @ group.pulled[other]
                fisher[k, other] += np.vdot(part, beside) - 2.0 * np.vdot(own, between)
        for k, squares, number in group.rest:
            score[k] += squares / sizes[k] ** 2 - number / sizes[k]
            fisher[k, k] += number / sizes[k] ** 2
            scale[k] = max(scale[k], 1.0 / sizes[k])
    reduced = covariance @ mixed
    score += np.trace(reduced, axis1=1, axis2=2)
    fisher += np.einsum("kij,lji->kl", reduced, reduced)
    return score, 0.5 * (fisher + fisher.T), scale
