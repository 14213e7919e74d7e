"""Rigs that the calibration tests share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

BROWN = (-0.1, 0.05, 0.0008, -0.0005, 0.01)


def simulated(
    pixel_std: float = 0.1,
    views: tuple[int, int] = (30, 10),
    target: CollinearTarget | None = None,
    distortion: str = "none",
    seed: int = 0,
    stated: bool = False,
) -> tuple[SimulatedRig, Rig]:
    """The paper's rig and what a person would know of it."""
    coefficients = {
        "none": (0.0,) * 5,
        "radial1": (BROWN[0], 0.0, 0.0, 0.0, 0.0),
        "radial2": (*BROWN[:2], 0.0, 0.0, 0.0),
        "brown": BROWN,
    }[distortion]
    truth = paper_rig(coefficients, target)
    observations = observed_rig(truth, *views, pixel_std, np.random.default_rng(seed))
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        distortion=distortion,
        pixel_std=pixel_std if stated else None,
        observations=observations,
    )
    return truth, rig


def two_lasers() -> SimulatedRig:
    """The paper's camera with a second sheet of light, from the other side."""
    rig = paper_rig((-0.1, 0.05, 0.0008, -0.0005, 0.01))
    first = rig.light_plane
    other = LightPlane(first.normal * [-1.0, 1.0, 1.0], first.distance_mm, "right")
    return replace(rig, light_planes=(replace(first, name="left"), other))
