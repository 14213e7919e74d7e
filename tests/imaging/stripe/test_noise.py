"""The noise law, from residuals whose law is known."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.stripe.noise import noise_law, redundancies


def test_both_parts_of_the_law_are_found():
    """20 000 samples: each part is good to 2 % (one standard deviation)."""
    rng = np.random.default_rng(1)
    light = np.where(rng.random(20_000) < 0.5, 0.0, rng.uniform(50.0, 150.0, 20_000))
    residuals = rng.normal(0.0, np.sqrt(4.0 + 0.05 * light))
    law = noise_law(residuals, light, np.ones_like(light), 0.3)
    assert law.dark_variance == pytest.approx(4.0, rel=0.08)
    assert law.variance_per_level == pytest.approx(0.05, rel=0.12)
    assert law.std(np.array([100.0]))[0] == pytest.approx(3.0, rel=0.05)


def test_redundancies_sum_to_the_degrees_of_freedom():
    rng = np.random.default_rng(2)
    jacobian = rng.normal(size=(50, 4))
    assert redundancies(jacobian, jacobian.T @ jacobian).sum() == pytest.approx(46.0)


def test_the_noise_is_never_less_than_that_of_rounding():
    law = noise_law(np.zeros(100), np.linspace(0.0, 50.0, 100), np.ones(100), 0.3)
    assert law.std(np.zeros(1))[0] == pytest.approx(0.3)
