"""Restricted maximum likelihood against dense algebra and direct maximisation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize

from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.estimation.variance_components import (
    Contrasts,
    contrasts,
    excess,
    reduced_model,
    variance_components,
)
from sheetoflight.geometry.directions import Array

GROUPS, RESIDUALS, SHARED, LOCAL = 20, 6, 4, 2
BOTH = np.array([True, True])
COLUMNS = np.arange(SHARED)


def along_the_diagonal(blocks: Array) -> Array:
    """A matrix ``(N m, N k)`` of blocks ``(N, m, k)``."""
    count, rows, columns = blocks.shape
    whole = np.zeros((count, rows, count, columns))
    places = np.arange(count)
    whole[places, :, places] = blocks
    return whole.reshape(count * rows, count * columns)


@dataclass(frozen=True)
class Problem:
    """Groups ``(N, r)`` with shared and own parameters and two noise components."""

    by_shared: Array
    by_local: Array
    parts: tuple[Array, Array]

    def drawn(self, sizes: tuple[float, float], rng: np.random.Generator) -> Array:
        """Residuals ``(N, r)`` of noise alone."""
        roots = np.linalg.cholesky(sum(s * p for s, p in zip(sizes, self.parts, strict=True)))
        return (roots @ rng.normal(size=(len(roots), roots.shape[1], 1)))[..., 0]

    def groups(self, residuals: Array, seen: np.ndarray | None = None) -> list[Contrasts]:
        """What `variance_components` is asked about."""
        block = Block(residuals, self.by_shared, COLUMNS, self.by_local)
        seen = np.ones(residuals.shape, dtype=bool) if seen is None else seen
        return [contrasts(block, tuple(enumerate(self.parts)), seen)]

    @property
    def design(self) -> Array:
        """Everything in one matrix: shared columns, then each group's own."""
        shared = self.by_shared.reshape(-1, SHARED)
        return np.hstack([shared, along_the_diagonal(self.by_local)])

    def covariance(self, sizes: Array) -> Array:
        """The whole covariance."""
        return along_the_diagonal(sizes[0] * self.parts[0] + sizes[1] * self.parts[1])


def problem(seed: int = 0, groups: int = GROUPS) -> Problem:
    rng = np.random.default_rng(seed)
    few = rng.normal(size=(groups, RESIDUALS, 2))
    own = np.broadcast_to(np.eye(RESIDUALS), (groups, RESIDUALS, RESIDUALS)) * rng.uniform(
        0.5, 2.0, (groups, RESIDUALS, 1)
    )
    return Problem(
        rng.normal(size=(groups, RESIDUALS, SHARED)),
        rng.normal(size=(groups, RESIDUALS, LOCAL)),
        (own.copy(), few @ np.swapaxes(few, 1, 2)),
    )


def restricted(given: Problem, residuals: Array, sizes: Array) -> float:
    """-2 log of the restricted likelihood: ``log|V| + log|AᵀV⁻¹A| + yᵀPy``."""
    design, values = given.design, residuals.ravel()
    whole = given.covariance(sizes)
    weighted = np.linalg.solve(whole, design)
    normal = design.T @ weighted
    rest = values - design @ np.linalg.solve(normal, weighted.T @ values)
    return float(
        np.linalg.slogdet(whole)[1]
        + np.linalg.slogdet(normal)[1]
        + rest @ np.linalg.solve(whole, rest)
    )


def test_one_component_is_chi_squared_over_degrees_of_freedom() -> None:
    given = problem()
    values = given.drawn((0.7, 0.0), np.random.default_rng(1))
    found = variance_components(
        given.groups(values), SHARED, np.array([2.0, 0.0]), np.array([True, False])
    )
    root = np.linalg.cholesky(given.covariance(np.array([1.0, 0.0])))
    design, right = np.linalg.solve(root, given.design), np.linalg.solve(root, values.ravel())
    rest = right - design @ np.linalg.lstsq(design, right)[0]
    freedom = GROUPS * (RESIDUALS - LOCAL) - SHARED
    expected = rest @ rest / freedom
    assert found.converged
    assert found.sizes[0] == pytest.approx(expected, rel=1e-6)
    assert found.covariance[0, 0] == pytest.approx(2.0 * expected**2 / freedom, rel=1e-5)
    assert not found.covariance[1].any()


@pytest.mark.parametrize("seed", range(6))
def test_two_components_maximise_the_restricted_likelihood(seed: int) -> None:
    """Nelder and Mead on dense matrices find the same maximum."""
    given = problem(seed)
    values = given.drawn((0.5, 1.5), np.random.default_rng(seed))
    found = variance_components(given.groups(values), SHARED, np.array([1.0, 1.0]), BOTH)
    direct = minimize(
        lambda logs: restricted(given, values, np.exp(logs)),
        np.zeros(2),
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-10},
    )
    assert found.converged
    assert found.sizes == pytest.approx(np.exp(direct.x), rel=1e-4)


def test_the_start_does_not_matter() -> None:
    given = problem()
    groups = given.groups(given.drawn((0.5, 1.5), np.random.default_rng(3)))
    near, far = (
        variance_components(groups, SHARED, np.array(start), BOTH).sizes
        for start in ((0.5, 1.5), (50.0, 1e-3))
    )
    assert far == pytest.approx(near, rel=1e-5)


def test_the_stated_covariance_is_the_scatter_of_the_estimates() -> None:
    """300 data sets: a variance of 300 scatters by 8 %, a correlation by 6 %. Four of these and
    a tenth for the likelihood's third order, with three numbers: odds below 2e-4."""
    given = problem(2, groups=60)
    rng = np.random.default_rng(4)
    true = (0.5, 1.5)
    estimates = []
    for _ in range(300):
        groups = given.groups(given.drawn(true, rng))
        estimates.append(variance_components(groups, SHARED, np.array(true), BOTH).sizes)
    found = np.array(estimates)
    at_truth = _expected_covariance(given, np.array(true))
    scatter = np.cov(found.T)
    assert np.diag(scatter) == pytest.approx(np.diag(at_truth), rel=4 * 0.08 + 0.1)
    scale = np.sqrt(np.diag(at_truth))
    assert (scatter / np.outer(scale, scale))[0, 1] == pytest.approx(
        (at_truth / np.outer(scale, scale))[0, 1], abs=4 * 0.06 + 0.1
    )
    # and there is no bias, which plain maximum likelihood has: it divides by all observations
    standard_error = scale / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - true) < 4 * standard_error).all()


def _expected_covariance(given: Problem, sizes: Array) -> Array:
    """Twice the inverse of ``tr(P V_k P V_l)``, dense."""
    inverse, design = np.linalg.inv(given.covariance(sizes)), given.design
    weighted = inverse @ design
    projector = inverse - weighted @ np.linalg.solve(design.T @ weighted, weighted.T)
    moved = [projector @ along_the_diagonal(part) for part in given.parts]
    fisher = np.array([[np.sum(a * b.T) for b in moved] for a in moved])
    return 2.0 * np.linalg.inv(fisher)


def test_the_covariance_is_that_of_dense_algebra() -> None:
    given = problem()
    groups = given.groups(given.drawn((0.5, 1.5), np.random.default_rng(5)))
    found = variance_components(groups, SHARED, np.array([0.5, 1.5]), BOTH)
    assert found.covariance == pytest.approx(_expected_covariance(given, found.sizes), rel=1e-4)


def test_a_component_that_explains_nothing_vanishes() -> None:
    """Without any of the second component, its likelihood falls from 0 on in half of all cases:
    both kinds occur in 20 with odds of 1 - 2e-6, and each is told as it is."""
    given = problem()
    fell = []
    for seed in range(20):
        values = given.drawn((0.5, 0.0), np.random.default_rng(seed))
        groups = given.groups(values)
        found = variance_components(groups, SHARED, np.array([1.0, 1.0]), BOTH)
        only = np.array([True, False])
        alone = variance_components(groups, SHARED, np.array([1.0, 0.0]), only).sizes
        little = alone + np.array([0.0, 1e-5])
        fell.append(restricted(given, values, little) > restricted(given, values, alone))
        assert (found.sizes[1] == 0.0) == fell[-1]
        if fell[-1]:
            assert found.converged
            assert found.sizes[0] == pytest.approx(alone[0], rel=1e-5)
            assert not found.covariance[1].any()
            assert found.covariance[0, 0] > 0
    assert 0 < sum(fell) < 20


def test_what_is_held_stays() -> None:
    given = problem()
    groups = given.groups(given.drawn((0.5, 1.5), np.random.default_rng(6)))
    found = variance_components(groups, SHARED, np.array([1.0, 1.5]), np.array([True, False]))
    assert found.sizes[1] == 1.5
    assert not found.covariance[1].any()
    assert found.sizes[0] == pytest.approx(0.5, rel=4 * np.sqrt(2 / 76))


def test_contrasts_do_not_see_the_groups_own_parameters() -> None:
    given = problem()
    rng = np.random.default_rng(7)
    values = given.drawn((0.5, 1.5), rng)
    own = (given.by_local @ rng.normal(scale=1e3, size=(GROUPS, LOCAL, 1)))[..., 0]
    (one,), (two,) = given.groups(values), given.groups(values + own)
    assert np.allclose(one.values, two.values, atol=1e-9)
    # nor how these are measured
    turned = Problem(
        given.by_shared, given.by_local @ np.array([[3.0, 1.0], [-2.0, 5.0]]), given.parts
    )
    sizes = np.array([1.0, 1.0])
    a, b = (
        variance_components(p.groups(values), SHARED, sizes, BOTH).sizes for p in (given, turned)
    )
    assert b == pytest.approx(a, rel=1e-6)


def test_the_reduced_model_is_the_schur_complement() -> None:
    given, sizes = problem(), np.array([0.5, 1.5])
    values = given.drawn((0.5, 1.5), np.random.default_rng(8))
    model = reduced_model(given.groups(values), SHARED, sizes)
    weighted = np.linalg.solve(given.covariance(sizes), given.design)
    whole = np.linalg.inv(given.design.T @ weighted)
    assert np.linalg.inv(model.information) == pytest.approx(whole[:SHARED, :SHARED], rel=1e-8)
    estimate = np.linalg.solve(model.information, model.gradient)
    assert estimate == pytest.approx((whole @ weighted.T @ values.ravel())[:SHARED], rel=1e-8)
    shares = sum(sizes[k] * share for (_, k), share in model.shares.items())
    assert shares == pytest.approx(model.information, rel=1e-9)


def _last_unseen(given: Problem) -> tuple[Problem, Problem]:
    """The problem with each group's last residual not observed, and without these."""
    seen = np.arange(RESIDUALS) < RESIDUALS - 1
    both = seen[:, None] & seen
    masked = Problem(
        given.by_shared * seen[:, None],
        given.by_local * seen[:, None],
        (given.parts[0] * both, given.parts[1] * both),
    )
    shorter = Problem(
        given.by_shared[:, seen],
        given.by_local[:, seen],
        (given.parts[0][:, seen][:, :, seen], given.parts[1][:, seen][:, :, seen]),
    )
    return masked, shorter


def test_what_was_not_seen_says_nothing() -> None:
    given = problem()
    masked, shorter = _last_unseen(given)
    values = given.drawn((0.5, 1.5), np.random.default_rng(9))
    seen = np.broadcast_to(np.arange(RESIDUALS) < RESIDUALS - 1, values.shape)
    with_gaps = masked.groups(np.where(seen, values, 0.0), seen)
    without = shorter.groups(values[:, :-1])
    sizes = np.array([0.7, 1.2])
    one, two = reduced_model(with_gaps, SHARED, sizes), reduced_model(without, SHARED, sizes)
    assert one.information == pytest.approx(two.information, rel=1e-9)
    assert one.gradient == pytest.approx(two.gradient, rel=1e-8, abs=1e-8)
    solve = partial(variance_components, size=SHARED, start=np.ones(2), free=BOTH)
    gaps, none = solve(with_gaps), solve(without)
    assert gaps.sizes == pytest.approx(none.sizes, rel=1e-6)
    assert gaps.covariance == pytest.approx(none.covariance, rel=1e-5)


def test_the_score_test_is_standard_normal_where_there_is_no_more() -> None:
    """200 data sets without the second component: the mean scatters by 1/sqrt(200), the standard
    deviation by 1/sqrt(400) (a quarter more for chi-squared's kurtosis): four each, odds 2e-4."""
    given, rng = problem(3, groups=60), np.random.default_rng(10)
    asked = []
    for _ in range(200):
        groups = given.groups(given.drawn((0.5, 0.0), rng))
        only = np.array([True, False])
        null = variance_components(groups, SHARED, np.array([0.5, 0.0]), only)
        asked.append(excess(null, BOTH)[1])
    assert np.mean(asked) == pytest.approx(0.0, abs=4 / np.sqrt(200))
    assert np.std(asked) == pytest.approx(1.0, abs=4 * 1.25 / np.sqrt(400))


def test_the_score_test_asks_for_what_is_there() -> None:
    given = problem()
    groups = given.groups(given.drawn((0.5, 5.0), np.random.default_rng(11)))
    only = np.array([True, False])
    null = variance_components(groups, SHARED, np.array([0.5, 0.0]), only)
    assert excess(null, BOTH)[1] > 5.0
