"""The block solver against dense algebra and SciPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from sheetoflight.estimation.block_least_squares import (
    Block,
    reduced_equations,
    scaled_inverse,
    solve,
)


@dataclass(frozen=True)
class Decay:
    """Curves ``amplitude_i exp(-rate t) + offset`` that share a rate and an offset; a second
    block shares the offset alone."""

    t: np.ndarray
    curves: np.ndarray
    levels: np.ndarray
    shared_size: int = 2

    def blocks(self, state: np.ndarray) -> list[Block]:
        rate, offset, amplitude, slopes = self.parts(state)
        decay = np.exp(-rate * self.t)
        count = len(self.curves)
        by_rate = -self.t * decay * amplitude[:, None]
        by_shared = np.stack([by_rate, np.ones_like(by_rate)], axis=-1)
        by_local = np.broadcast_to(decay[:, None], (count, len(self.t), 1))
        first = Block(
            amplitude[:, None] * decay + offset - self.curves, by_shared, np.array([0, 1]), by_local
        )
        second = Block(
            offset + slopes[:, None] * self.t - self.levels,
            np.ones((*self.levels.shape, 1)),
            np.array([1]),
            np.broadcast_to(self.t[:, None], (*self.levels.shape, 1)),
        )
        return [first, second]

    def parts(self, state: np.ndarray) -> tuple[float, float, np.ndarray, np.ndarray]:
        count = len(self.curves)
        return state[0], state[1], state[2 : 2 + count], state[2 + count :]

    def moved(
        self, state: np.ndarray, shared: np.ndarray, local: Sequence[np.ndarray]
    ) -> np.ndarray:
        return state + np.concatenate([shared, *(steps.ravel() for steps in local)])

    def flat(self, state: np.ndarray) -> np.ndarray:
        return np.concatenate([block.residuals.ravel() for block in self.blocks(state)])


@pytest.fixture
def decay() -> Decay:
    rng = np.random.default_rng(5)
    t = np.linspace(0, 2, 15)
    amplitude = rng.uniform(1, 5, (6, 1))
    curves = amplitude * np.exp(-1.3 * t) + 0.4 + rng.normal(scale=0.02, size=(6, 15))
    levels = 0.4 + rng.uniform(-1, 1, (4, 1)) * t + rng.normal(scale=0.02, size=(4, 15))
    return Decay(t, curves, levels)


def start(problem: Decay) -> np.ndarray:
    return np.concatenate([[0.5, 0.0], np.ones(len(problem.curves)), np.zeros(len(problem.levels))])


def dense_normal_equations(problem: Decay, state: np.ndarray) -> np.ndarray:
    columns = []
    for index in range(len(state)):
        step = 1e-6 * np.eye(len(state))[index]
        columns.append((problem.flat(state + step) - problem.flat(state - step)) / 2e-6)
    jacobian = np.stack(columns, axis=1)
    return jacobian.T @ jacobian


def test_the_minimum_is_scipys(decay: Decay) -> None:
    ours = solve(decay, start(decay))
    theirs = least_squares(
        decay.flat, start(decay), jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    assert ours.converged
    assert np.allclose(ours.state, theirs.x, rtol=1e-8)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-10)


def test_the_information_is_the_dense_schur_complement(decay: Decay) -> None:
    solution = solve(decay, start(decay))
    normal = dense_normal_equations(decay, solution.state)
    schur = normal[:2, :2] - normal[:2, 2:] @ np.linalg.solve(normal[2:, 2:], normal[2:, :2])
    assert np.allclose(reduced_equations(decay.blocks(solution.state), 2)[0], schur, rtol=1e-6)


def test_the_covariance_is_the_corner_of_the_dense_inverse(decay: Decay) -> None:
    solution = solve(decay, start(decay))
    covariance, condition = scaled_inverse(reduced_equations(decay.blocks(solution.state), 2)[0])
    dense = np.linalg.inv(dense_normal_equations(decay, solution.state))
    assert np.allclose(covariance, dense[:2, :2], rtol=1e-6)
    assert condition >= 1


def test_the_cost_never_rises_from_a_bad_start(decay: Decay) -> None:
    bad = start(decay)
    bad[0] = 30.0
    before = sum(block.cost for block in decay.blocks(bad))
    assert solve(decay, bad).cost < before


def test_units_of_the_parameters_do_not_matter() -> None:
    information = np.array([[2.0, 0.3], [0.3, 1.0]])
    units = np.array([1e-9, 1e9])
    scaled, _ = scaled_inverse(information * units[:, None] * units)
    plain, _ = scaled_inverse(information)
    assert np.allclose(scaled * units[:, None] * units, plain, rtol=1e-12)


@pytest.mark.parametrize(
    "information",
    [
        np.zeros((2, 2)),
        np.ones((2, 2)),
        np.array([[1.0, 2.0], [2.0, 1.0]]),
        np.full((2, 2), np.nan),
    ],
    ids=["empty", "singular", "indefinite", "nan"],
)
def test_undetermined_parameters_have_no_covariance(information: np.ndarray) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        scaled_inverse(information)


@dataclass(frozen=True)
class BentValleys:
    """Rosenbrock's function for many groups with one shared parameter:
    ``r = (100 (b_i − 5 a²) + …)``, whose floor ``b_i = 5 a²`` is bent in the shared parameter."""

    count: int = 8
    shared_size: int = 1

    def blocks(self, state: np.ndarray) -> list[Block]:
        a, b = state[0], state[1:]
        wall = 1e4 * (b - 5.0 * np.sin(3.0 * a) - 5.0 * a**2)
        floor = np.full_like(b, a - 4.0)
        slope = -1e4 * (15.0 * np.cos(3.0 * a) + 10.0 * a)
        return [
            Block(
                np.stack([wall, floor], axis=1),
                np.broadcast_to(np.array([[slope], [1.0]]), (self.count, 2, 1)),
                np.array([0]),
                np.broadcast_to(np.array([[1e4], [0.0]]), (self.count, 2, 1)),
            )
        ]

    def moved(
        self, state: np.ndarray, shared: np.ndarray, local: Sequence[np.ndarray]
    ) -> np.ndarray:
        return state + np.concatenate([shared, local[0].ravel()])


def test_a_bent_valley_is_followed_to_its_end() -> None:
    """Common steps alone would leave its floor again and again: with 300 of them they do not
    arrive. Settling the groups' own parameters at every step does, in a tenth of that."""
    problem = BentValleys()
    found = solve(problem, np.concatenate([[-2.0], np.full(problem.count, 3.0)]))
    assert found.converged
    assert found.iterations < 60
    assert found.state[0] == pytest.approx(4.0, abs=1e-6)
    assert found.cost < 1e-10
