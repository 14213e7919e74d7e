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


def test_a_points_own_std_comes_first() -> None:
    own = np.full((2, 3), 0.05)
    own[1, 2] = np.nan
    assert np.isclose(noise_model(views(own), 0.3).std["camera"][1, 2], 0.3)
    assert np.isclose(noise_model(views(own), 0.3).std["camera"][0, 0], 0.05)
    assert not noise_model(views(own), None).stated
    assert noise_model(views(np.full((2, 3), 0.05)), None).stated


def test_the_limit_is_the_quantile_of_chi_squared() -> None:
    assert chi2_limit(110) == pytest.approx(chi2.isf(1e-3, 110))
