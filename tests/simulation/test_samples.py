"""Samples, tiles and the lens blur."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.model.camera import Camera
from sheetoflight.simulation.rays import ray_grid
from sheetoflight.simulation.samples import Tile, blur_border, blur_weights, tiles

CAMERA = Camera((96, 80), 140.0, 138.0, 47.0, 41.0, distortion=(-0.1, 0.0, 0.001, 0.0, 0.0))


@pytest.mark.parametrize("defocus", [0.0, 0.3, 0.7, 2.0])
def test_blur_keeps_light_place_and_width(defocus):
    """A pixel's weights sum to one, are centred on it, and have the variance of the Gaussian
    and the pixel together, the samples' own share of 1/(12 S²) being counted once.

    The Gaussian is cut at 4.5 standard deviations or more; what lies beyond on one side carries
    2e-5 standard deviations of its mean, and on both sides 2e-4 of its variance.
    """
    border, sampling, pixels = blur_border(defocus), 4, 5
    weights = blur_weights(pixels, border, sampling, defocus)
    at = (np.arange(weights.shape[1]) + 0.5) / sampling - 0.5 - border
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(weights @ at, np.arange(pixels), atol=2e-5 * defocus + 1e-12)
    variance = weights @ at**2 - (weights @ at) ** 2 + 1 / (12 * sampling**2)
    np.testing.assert_allclose(variance, defocus**2 + 1 / 12, atol=2e-4 * defocus**2 + 1e-5)


def test_tiles_cover_every_pixel_once():
    counted = np.zeros((83, 131), dtype=int)
    for tile in tiles(131, 83, 32, 4):
        counted[tile.window] += 1
    assert (counted == 1).all()


def test_fine_samples_lie_where_the_lens_puts_them():
    """Projected back, sample k of pixel j stands at ``j + (k + 1/2)/S − 1/2`` px."""
    tile = Tile(range(16, 40), range(60, 96), border=3)
    samples = tile.fine(ray_grid(CAMERA, 4), 4)
    rays = np.stack([samples.x, samples.y, np.ones_like(samples.x)], axis=-1)
    u = 60 - 3 - 0.5 + (np.arange((36 + 6) * 4) + 0.5) / 4
    v = 16 - 3 - 0.5 + (np.arange((24 + 6) * 4) + 0.5) / 4
    expected = np.stack(np.meshgrid(u, v), axis=-1)
    # linear interpolation over 1 px errs by at most 1/8 of the second derivative, 6 k1 x/f
    bound = 6 * 0.1 * 0.5 / 140 / 8 * 2
    np.testing.assert_allclose(CAMERA.project(rays), expected, atol=bound)


@pytest.mark.parametrize("size", [3, 15])
def test_slopes_are_the_change_of_the_coordinates_per_pixel(size):
    """Against differences over one pixel to either side, on an oblique surface: in a block so
    small that perspective hardly changes, and in one where it does. What is left is the lens,
    whose slope is taken half a pixel aside: 0.2 % here."""
    rows = np.array([[900.0, 30.0, 12.0], [-40.0, 870.0, 5.0], [0.35, -0.2, 0.9]])
    tile = Tile(range(30, 30 + size), range(40, 40 + size), border=2)
    samples = tile.coarse(ray_grid(CAMERA, 4), 0, 1.0)
    chart = samples.charted(rows)
    i = j = size // 2
    for values, slopes in ((chart.a, chart.a_per_px), (chart.b, chart.b_per_px)):
        expected = (
            (values[i, j + 1] - values[i, j - 1]) / 2,
            (values[i + 1, j] - values[i - 1, j]) / 2,
        )
        found = [np.broadcast_to(slope, values.shape)[i, j] for slope in slopes]
        bound = 2e-3 * float(np.abs(expected).max())
        np.testing.assert_allclose(found, expected, rtol=0, atol=bound)
