"""What the tests of files share: one rig, its observations and a calibration of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance, NoiseComponents, Source
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
def two_lasers(observations: Observations) -> Observations:
    """Views of every stage with two lasers: both in plane and crossing, one spot unseen."""
    rng = np.random.default_rng(6)
    spots = rng.uniform(0, 1000, (4, 5, 2))
    spots[1, 4] = spots[2, 3] = spots[2, 0] = np.nan
    names = ("left only", "right only", "one", "both")
    laser = np.arange(len(observations.plane)) % 2
    plane = TargetViews(observations.plane.names, observations.plane.uv, None, laser)
    return Observations(observations.camera, plane, TargetViews(names, spots[[1, 2, 0, 3]]))


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


@pytest.fixture(scope="session")
def explained(calibration: Calibration) -> Calibration:
    """The same with two sheets, a warm target, views of all stages, and a covariance whose
    sources are known."""
    rng = np.random.default_rng(8)
    parts = ("nx", "ny", "nz", "d")
    names = tuple(f"camera.{p}" for p in Camera.PARAMETERS)
    names += tuple(f"{sheet}.{part}" for sheet in ("left", "right") for part in parts)
    scale = np.geomspace(1e-4, 10, len(names))
    factors = rng.normal(size=(3, len(names), 3)) * scale[:, None]
    shares = factors @ factors.transpose(0, 2, 1)
    uv, xyz = rng.normal(size=(5, 2)), rng.normal(size=(5, 3))
    uv[3] = np.nan
    views = (
        *calibration.residuals.views,
        ViewResiduals("crossing", "one spot of two", uv, uv / 7, xyz),
    )
    (plane,) = calibration.light_planes
    return replace(
        calibration,
        light_planes=(
            LightPlane(plane.normal, plane.distance_mm, "left"),
            LightPlane(np.array([-0.9, 0.1, 0.4]), 480.0 / 7, "right"),
        ),
        target=CollinearTarget((0.0, 120.0, 300.0), 0.01, "disc", 12.0, 11.5e-6, -4.7, 1 / 3, 1e-7),
        covariance=Covariance(
            names,
            shares.sum(axis=0),
            (
                Source("camera", shares[0], "pixel"),
                Source("placement", shares[1], "placement"),
                Source("target length", shares[2]),
            ),
            NoiseComponents(
                ("pixel", "placement"), (0.1 / 3, 0.3), np.array([[0.2, -0.1 / 3], [-0.1 / 3, 0.7]])
            ),
        ),
        residuals=replace(calibration.residuals, views=views),
    )
