"""What the tests of files share: one rig, its observations and a calibration of it."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.model.calibration import Calibration, Covariance, Residuals, ViewResiduals
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig


@pytest.fixture(scope="session")
def target() -> CollinearTarget:
    return CollinearTarget((0.0, 120.0, 300.0), 0.01)


@pytest.fixture(scope="session")
def observations() -> Observations:
    """Eight views of each stage; one marker unseen, one uncertainty known."""
    seen = observed_rig(paper_rig(), 8, 8, 0.1, np.random.default_rng(5))
    uv = np.array(seen.camera.uv)
    uv[2, 1] = np.nan
    std = np.full(uv.shape[:2], np.nan)
    std[0, 0] = 0.1 + 0.2
    return Observations(TargetViews(seen.camera.names, uv, std), seen.plane)


@pytest.fixture(scope="session")
def calibration(target: CollinearTarget) -> Calibration:
    """Numbers without short decimal forms in every place."""
    rng = np.random.default_rng(7)
    names = tuple(f"camera.{p}" for p in Camera.PARAMETERS)
    names += ("laser.nx", "laser.ny", "laser.nz", "laser.d")
    factor = rng.normal(size=(len(names), len(names))) * np.geomspace(1e-4, 10, len(names))
    covariance = factor.T @ factor
    uv, residuals, xyz = rng.normal(size=(3, 2)), rng.normal(size=(3, 2)), rng.normal(size=(3, 3))
    unseen = np.array(uv)
    unseen[1] = np.nan
    return Calibration(
        method="joint",
        camera=Camera(
            (1392, 1040),
            2298.7 / 3,
            2288.7 / 7,
            689.341,
            537.903,
            0.1,
            (-0.1, 1 / 3, 1e-17, 0.0, 5e-324),
        ),
        light_planes=(LightPlane(np.array([0.9098, 0.08722, 0.40578]), 562.334),),
        covariance=Covariance(names, (covariance + covariance.T) / 2),
        residuals=Residuals(
            0.1 / 3,
            0.97,
            (
                ViewResiduals("camera", "one", uv, residuals, xyz),
                ViewResiduals("plane", "two – 2", unseen, unseen * np.array([1.0, -1.0]), xyz),
            ),
        ),
        target=target,
        pixel_std=0.1 / 3,
        warnings=("the views lie nearly in one plane – add tilted ones",),
        provenance={"files": ["rig.toml"], "options": {"skew": False, "seed": 1}},
    )
