"""Stated and estimated noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sheetoflight.calibration.components import COMPONENTS, PLACEMENT
from sheetoflight.calibration.noise import chi2_limit, noise_model
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

UV = np.zeros((2, 3, 2))


def seen(std: np.ndarray | None = None, pixel_std: float | None = None) -> Rig:
    views = TargetViews(("a", "b"), UV, std)
    return Rig(CollinearTarget(), (9, 9), pixel_std=pixel_std, observations=Observations(views))


def estimated(rig: Rig) -> set[str]:
    return {name for name, free in zip(COMPONENTS, noise_model(rig).free, strict=True) if free}


def test_what_is_not_stated_is_estimated() -> None:
    assert estimated(seen()) == {"pixel"}
    assert estimated(seen(pixel_std=0.2)) == set()
    lying = replace(seen(), observations=Observations(plane=TargetViews(("a", "b"), UV)))
    assert estimated(lying) == {"pixel", "placement", "marker"}
    placed = replace(lying, placement_std=0.3)
    assert estimated(placed) == {"pixel"}
    assert noise_model(placed).variances[PLACEMENT] == pytest.approx(0.09)


def test_the_points_own_std_give_the_proportions_of_the_noise() -> None:
    own = np.array([[0.03, 0.03, 0.03], [0.05, 0.05, np.nan]])
    typical = np.sqrt((3 * 0.03**2 + 2 * 0.05**2) / 5)
    unknown = noise_model(seen(own))
    assert np.allclose(unknown.std("camera"), [[0.03, 0.03, 0.03], [0.05, 0.05, typical]])
    stated = noise_model(seen(own, 0.4))
    assert np.allclose(stated.std("camera") / unknown.std("camera"), 0.4 / typical)


def test_the_limit_is_the_quantile_of_chi_squared() -> None:
    assert chi2_limit(110) == pytest.approx(chi2.isf(1e-3, 110))
