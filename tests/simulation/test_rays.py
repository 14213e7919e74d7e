"""Rays of the pixel grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.camera import Camera
from sheetoflight.simulation.rays import ray_grid

CAMERA = Camera((180, 130), 240.0, 236.0, 91.0, 63.0, gamma=0.7)


@pytest.mark.parametrize(
    "distortion",
    [(0.0, 0.0, 0.0, 0.0, 0.0), (-0.25, 0.08, 0.003, -0.002, 0.01), (0.2, 0.0, 0.0, 0.0, 0.0)],
    ids=["none", "barrel", "pincushion"],
)
def test_every_ray_projects_onto_its_pixel(distortion):
    """Also in the border. 1e-4 px is a fiftieth of the pictures' stated accuracy."""
    camera = replace(CAMERA, distortion=distortion)
    grid = ray_grid(camera, 6)
    uv = camera.project(np.stack([grid.x, grid.y, np.ones_like(grid.x)], axis=-1))
    v, u = np.mgrid[-6:136, -6:186]
    np.testing.assert_allclose(uv, np.stack([u, v], axis=-1), atol=1e-4)


def test_block_is_addressed_by_pixel():
    """Pixel (0, 0) is the picture's first, whatever the border."""
    narrow, wide = ray_grid(CAMERA, 2), ray_grid(CAMERA, 9)
    for a, b in zip(
        narrow.block(range(-2, 5), range(3, 8)), wide.block(range(-2, 5), range(3, 8)), strict=True
    ):
        np.testing.assert_allclose(a, b, atol=1e-12)


@pytest.mark.parametrize("k1", [-1.2, -3.0])
def test_a_lens_without_inverse_is_refused(k1):
    """The model's radius turns back at r² = -1/(3 k1), inside the picture's corner."""
    camera = replace(CAMERA, distortion=(k1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="no inverse over the whole picture"):
        ray_grid(camera, 2)
