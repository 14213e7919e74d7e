"""Grey values and their noise."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.markers.grey import grey_picture


@pytest.mark.parametrize("std", [1.0, 3.0, 8.0])
def test_noise_is_that_of_the_pixels(std: float) -> None:
    slope = np.linspace(40, 200, 400)[None, :] + np.linspace(0, 20, 300)[:, None]
    slope[100:200, 150:250] = 10.0
    noisy = slope + np.random.default_rng(1).normal(0, std, slope.shape)
    found = grey_picture(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)).noise
    # 30 000 correlated values: good to 1 %, and the patch's outline, 1 % of the picture,
    # shifts it by as much. Rounding adds 1/12.
    assert found == pytest.approx(np.sqrt(std**2 + 1 / 12), rel=0.04)


def test_colour_and_depth_do_not_matter() -> None:
    grey = np.random.default_rng(2).integers(0, 256, (40, 60), dtype=np.uint8)
    grey[0, 0] = 255
    expected = grey_picture(grey).values
    for same in (
        np.repeat(grey[..., None], 3, axis=2),
        grey.astype(np.uint16) * 257,
        grey / 255.0,
        grey.astype(np.float32)[..., None],
    ):
        assert np.allclose(grey_picture(same).values, expected, atol=1e-3)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros(5),
        np.zeros((4, 50, 50)),
        np.zeros((3, 3)),
        np.full((40, 40), np.nan),
        np.zeros((40, 40), complex),
        np.zeros((40, 40), bool),
    ],
    ids=["one row", "four planes", "tiny", "not finite", "complex", "bool"],
)
def test_what_is_no_picture_is_refused(image: np.ndarray) -> None:
    with pytest.raises(InputError):
        grey_picture(image)
