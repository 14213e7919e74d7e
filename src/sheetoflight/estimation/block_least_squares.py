"""Least squares with few shared parameters and many small groups of local ones.

The normal equations of such a problem have an arrowhead: every group's local parameters meet
only themselves and the shared ones. Eliminating them group by group (the Schur complement)
costs time and memory in proportion to the number of groups. Levenberg's and Marquardt's damping
makes each step safe: Marquardt, J. SIAM 11(2), 1963; the schedule is Nielsen's, report
IMM-REP-1999-05, Technical University of Denmark. The elimination is that of Triggs et al.,
"Bundle adjustment – a modern synthesis", 2000, section 6.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from sheetoflight.geometry.directions import Array

State = TypeVar("State")


@dataclass(frozen=True)
class Block:
    """Residuals of N alike groups, each with k local parameters.

    Parameters
    ----------
    residuals : (N, m) array
        In units of their standard uncertainty.
    by_shared : (N, m, s) array
        Derivatives by the shared parameters that `columns` names.
    columns : (s,) int array
        Which of all shared parameters those are.
    by_local : (N, m, k) array
        Derivatives by the group's own parameters.
    """

    residuals: Array
    by_shared: Array
    columns: np.ndarray
    by_local: Array

    @property
    def cost(self) -> float:
        """Half the sum of squares."""
        flat = self.residuals.ravel()
        return 0.5 * float(flat @ flat)


class BlockProblem(Protocol[State]):
    """What `solve` minimises. The state may live on any manifold."""

    @property
    def shared_size(self) -> int:
        """Number of shared parameters."""
        ...

    def blocks(self, state: State) -> Sequence[Block]:
        """Residuals and derivatives at a state."""
        ...

    def moved(self, state: State, shared: Array, local: Sequence[Array]) -> State:
        """The state after a step: ``(shared_size,)`` and one ``(N, k)`` for each block."""
        ...


_STRAIGHT = 20
"""Steps after which a path that has not ended is taken for a bent one."""

_RELAXATIONS = 4
_RELAXED_DAMPING = 1e-3


@dataclass(frozen=True)
class SolverOptions:
    """When to stop, and how to begin.

    Parameters
    ----------
    tolerance : float
        A step that promises to lower the cost by less than this part of it is the last. It is
        some 1e-5 standard uncertainties long: too short for the linear model to be wrong about
        it, so it is taken and not evaluated again.
    iterations : int
        The most steps.
    damping : float
        At the start, relative to the diagonal of the normal equations.
    """

    tolerance: float = 1e-11
    iterations: int = 300
    damping: float = 1e-7


@dataclass(frozen=True)
class Solution(Generic[State]):
    """A minimum.

    Parameters
    ----------
    state
        Where it lies.
    cost : float
        Half the sum of squares there.
    iterations : int
    converged : bool
        False if `SolverOptions.iterations` ran out, or no step was finite.
    """

    state: State
    cost: float
    iterations: int
    converged: bool

    @classmethod
    def awaited(cls, state: State) -> Solution[State]:
        """That of a problem which is yet to be solved, from a state beside it."""
        return cls(state, np.inf, 0, converged=False)

    @property
    def found(self) -> bool:
        """Whether it was solved for."""
        return self.iterations > 0


@dataclass(frozen=True)
class _Elimination:
    """One block's share of the normal equations, the gradient being their last column."""

    columns: np.ndarray
    shared: Array  # (s + 1, s + 1), the corner being twice the cost
    mixed: Array  # (N, k, s + 1)
    local: Array  # (N, k, k)

    @classmethod
    def of(cls, block: Block) -> _Elimination:
        whole = np.concatenate([block.by_shared, block.residuals[..., None]], axis=2)
        flat = whole.reshape(-1, whole.shape[2])
        transposed_local = block.by_local.transpose(0, 2, 1)
        return cls(
            columns=block.columns,
            shared=flat.T @ flat,
            mixed=transposed_local @ whole,
            local=transposed_local @ block.by_local,
        )

    def solved(self, damping: float) -> Array:
        """Local normal equations solved for `mixed`, ``(N, k, s + 1)``."""
        local = self.local
        if damping:
            local = local * (1.0 + damping * np.eye(local.shape[-1]))
        return np.linalg.solve(local, self.mixed)

    def reduced(self, solved: Array) -> Array:
        """What is left of the shared equations, ``(s + 1, s + 1)``."""
        width = self.mixed.shape[2]
        return self.shared - self.mixed.reshape(-1, width).T @ solved.reshape(-1, width)

    def gain(self, shared: Array, local: Array, damping: float) -> float:
        """Drop of ½‖r + J δ‖² along a damped step: ``½ δᵀ (λ D δ − g)`` with the gradient g and
        the diagonal D of the normal equations ``(A + λ D) δ = −g``."""
        own = np.einsum("nkk->nk", self.local)
        pull = shared @ (damping * np.diag(self.shared)[:-1] * shared - self.shared[:-1, -1])
        return 0.5 * float(pull + np.vdot(local, damping * own * local - self.mixed[..., -1]))


def solve(
    problem: BlockProblem[State], state: State, options: SolverOptions | None = None
) -> Solution[State]:
    """Minimise half the sum of squares from a starting state.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a group's own parameters are undetermined.
    """
    options = options or SolverOptions()
    damping, growth = options.damping, 2.0
    blocks = problem.blocks(state)
    cost = _cost(blocks)
    parts = [_Elimination.of(block) for block in blocks]
    converged, iterations = False, 0
    while iterations < options.iterations and np.isfinite(cost):
        iterations += 1
        shared, local, gain = _step(parts, problem.shared_size, damping)
        candidate = problem.moved(state, shared, local)
        if gain <= options.tolerance * cost + np.finfo(float).tiny:
            state, cost, converged = candidate, cost - gain, True
            break
        with np.errstate(over="ignore", invalid="ignore"):  # a wild step is refused below
            trial_blocks = problem.blocks(candidate)
            if iterations > _STRAIGHT and np.isfinite(_cost(trial_blocks)):
                candidate, trial_blocks = _relaxed(problem, candidate, trial_blocks)
            trial = _cost(trial_blocks)
        ratio = (cost - trial) / gain if np.isfinite(trial) else -1.0
        if ratio > 0:
            state, cost, blocks = candidate, trial, trial_blocks
            parts = [_Elimination.of(block) for block in blocks]
            damping *= max(1e-3, 1.0 - (2.0 * ratio - 1.0) ** 3)
            growth = 2.0
        elif gain <= 1e3 * np.finfo(float).eps * cost:
            converged = True  # the promised gain drowns in rounding: this is the minimum
            break
        else:
            damping *= growth
            growth *= 2.0
    return Solution(state, cost, iterations, bool(converged))


def _relaxed(
    problem: BlockProblem[State], state: State, blocks: Sequence[Block]
) -> tuple[State, Sequence[Block]]:
    """The state with the groups' own parameters settled, the shared ones held.

    Where groups are strongly curved in their own parameters, common steps must follow a narrow
    bent valley; this puts every candidate onto its floor (embedded point iterations: Jeong et
    al., PAMI 34(8), 2012).
    """
    still = np.zeros(problem.shared_size)
    for _ in range(_RELAXATIONS):
        steps = [_local_step(block) for block in blocks]
        tried = problem.blocks(problem.moved(state, still, steps))
        better = [_costs(new) < _costs(old) for new, old in zip(tried, blocks, strict=True)]
        if not any(mask.any() for mask in better):
            break
        steps = [np.where(mask[:, None], s, 0.0) for mask, s in zip(better, steps, strict=True)]
        state = problem.moved(state, still, steps)
        blocks = problem.blocks(state)
    return state, blocks


def _local_step(block: Block) -> Array:
    """A slightly damped step ``(N, k)`` of the groups' own parameters."""
    pull = np.swapaxes(block.by_local, 1, 2)
    normal = pull @ block.by_local
    normal = normal * (1.0 + _RELAXED_DAMPING * np.eye(normal.shape[-1]))
    return -np.linalg.solve(normal, pull @ block.residuals[..., None])[..., 0]


def _costs(block: Block) -> Array:
    """Sum of squares ``(N,)`` of each group; infinite where it cannot be."""
    return np.nan_to_num(np.sum(block.residuals**2, axis=1), nan=np.inf)


def reduced_equations(blocks: Sequence[Block], size: int) -> tuple[Array, Array]:
    """Information ``(size, size)`` and gradient ``(size,)`` of the shared parameters, all others
    eliminated."""
    parts = [_Elimination.of(block) for block in blocks]
    matrix, gradient = _reduced(parts, [part.solved(0.0) for part in parts], size)
    return 0.5 * (matrix + matrix.T), gradient


def _reduced(
    parts: Sequence[_Elimination], solved: Sequence[Array], size: int
) -> tuple[Array, Array]:
    """Matrix and gradient of the shared parameters, the groups' own eliminated."""
    matrix, gradient = np.zeros((size, size)), np.zeros(size)
    for part, own in zip(parts, solved, strict=True):
        reduced = part.reduced(own)
        matrix[part.columns[:, None], part.columns] += reduced[:-1, :-1]
        gradient[part.columns] += reduced[:-1, -1]
    return matrix, gradient


def scaled_inverse(information: Array) -> tuple[Array, float]:
    """Covariance from an information matrix, scaled to a unit diagonal before it is inverted.

    Returns
    -------
    covariance : (P, P) array
    condition : float
        Condition number of the scaled matrix.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is not positive definite to working precision.
    """
    diagonal = np.diag(information)
    if not np.isfinite(information).all() or np.any(diagonal <= 0):
        raise np.linalg.LinAlgError("a parameter has no influence on the observations")
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    if values[0] <= len(values) * np.finfo(float).eps * values[-1]:
        raise np.linalg.LinAlgError("a combination of parameters is undetermined")
    root = vectors / np.sqrt(values) * scale[:, None]
    return root @ root.T, float(values[-1] / values[0])


def _cost(blocks: Sequence[Block]) -> float:
    return sum(block.cost for block in blocks)


def _step(
    parts: Sequence[_Elimination], size: int, damping: float
) -> tuple[Array, list[Array], float]:
    """A damped Gauss-Newton step and the drop in cost that the linear model promises."""
    solved = [part.solved(damping) for part in parts]
    matrix, gradient = _reduced(parts, solved, size)
    for part in parts:
        matrix[part.columns, part.columns] += damping * np.diag(part.shared)[:-1]
    shared = -_solved_symmetric(matrix, gradient)
    local, gain = [], 0.0
    for part, own in zip(parts, solved, strict=True):
        here = shared[part.columns]
        step = -(own[..., :-1] @ here + own[..., -1])
        local.append(step)
        gain += part.gain(here, step, damping)
    return shared, local, gain


def _solved_symmetric(matrix: Array, right: Array) -> Array:
    """Solve with a unit diagonal, so that units do not matter; least norm where singular."""
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = matrix * scale[:, None] * scale
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * np.linalg.lstsq(scaled, scale * right, rcond=None)[0]
