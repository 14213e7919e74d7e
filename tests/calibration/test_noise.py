"""Stated and estimated noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from sheetoflight.calibration.noise import chi2_limit, noise_model
from sheetoflight.model.observations import TargetViews

UV = np.zeros((2, 3, 2))


def views(std: np.ndarray | None = None) -> dict[str, TargetViews]:
    return {"camera": TargetViews(("a", "b"), UV, std)}


def test_unknown_noise_has_one_scale_to_be_estimated() -> None:
    noise = noise_model(views(), None)
    assert not noise.stated
    assert noise.variance_factor(0.5, 50) == pytest.approx(0.01)
    assert noise.typical_std(0.01) == pytest.approx(0.1)


def test_stated_noise_grows_but_does_not_shrink() -> None:
    noise = noise_model(views(), 0.2)
    assert noise.stated
    assert (noise.std["camera"] == 0.2).all()
    assert noise.variance_factor(25.0, 50) == 1.0
    assert noise.variance_factor(100.0, 50) == 2.0
    assert noise.variance_factor(0.0, 0) == 1.0


def test_the_points_own_std_give_the_proportions_of_the_noise() -> None:
    own = np.array([[0.03, 0.03, 0.03], [0.05, 0.05, np.nan]])
    typical = np.sqrt((3 * 0.03**2 + 2 * 0.05**2) / 5)
    unknown = noise_model(views(own), None)
    assert not unknown.stated
    assert np.allclose(unknown.std["camera"], [[0.03, 0.03, 0.03], [0.05, 0.05, typical]])
    stated = noise_model(views(own), 0.4)
    assert stated.stated
    assert np.allclose(stated.std["camera"] / unknown.std["camera"], 0.4 / typical)
    assert stated.typical_std(1.0) == pytest.approx(0.4)


def test_the_limit_is_the_quantile_of_chi_squared() -> None:
    assert chi2_limit(110) == pytest.approx(chi2.isf(1e-3, 110))
