"""A rig with a small picture, so that a whole picture is rendered in milliseconds."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.rig import SimulatedRig


@pytest.fixture
def small_rig() -> SimulatedRig:
    """320 × 240 px; the sheet stands oblique 500 mm away, the projector 600 mm to the right."""
    plane = LightPlane(np.array([0.9, 0.1, 0.42]), 500.0)
    foot = plane.normal * plane.distance_mm
    sideways = np.cross([0.0, 1.0, 0.0], plane.normal)
    sideways /= np.linalg.norm(sideways)
    sideways = sideways if sideways[2] < 0 else -sideways
    return SimulatedRig(
        camera=Camera((320, 240), 520.0, 515.0, 161.3, 118.2),
        light_planes=(plane,),
        target=CollinearTarget((0.0, 110.0, 260.0), marker_size_mm=30.0),
        anchor_mm=np.array([0.0, -90.0, 950.0]),
        projector_mm=foot + 300.0 * sideways,
        depth_mm=(850.0, 1150.0),
    )
