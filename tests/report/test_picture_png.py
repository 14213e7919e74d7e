"""Embedded pictures: what a browser decodes is what was measured, only smaller."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.report.picture_png import embedded

PREFIX = "data:image/png;base64,"


def decoded(uri: str) -> np.ndarray:
    assert uri.startswith(PREFIX)
    content = np.frombuffer(base64.b64decode(uri.removeprefix(PREFIX)), np.uint8)
    image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)


def test_a_small_picture_is_embedded_without_loss():
    image = noise(30, 40)
    ((grey, binary),) = embedded([MeasuredPicture("a", image, image > 100)])
    assert np.array_equal(decoded(grey), image)
    assert np.array_equal(decoded(binary) > 0, image > 100)


def test_without_a_binary_picture_none_is_embedded():
    ((_, binary),) = embedded([MeasuredPicture("a", noise(4, 5))])
    assert binary == ""


def test_sixteen_bits_are_scaled_to_the_brightest_pixel():
    image = np.array([[0, 500, 1000]], np.uint16)
    ((grey, _),) = embedded([MeasuredPicture("a", image)])
    assert decoded(grey).tolist() == [[0, 128, 255]]


def test_a_black_picture_stays_black():
    ((grey, _),) = embedded([MeasuredPicture("a", np.zeros((3, 4), np.uint16))])
    assert not decoded(grey).any()


def test_a_wide_picture_is_narrowed_in_proportion():
    ((grey, _),) = embedded([MeasuredPicture("a", np.zeros((1040, 1392), np.uint8))])
    assert decoded(grey).shape == (747, 1000)


@pytest.mark.parametrize("column", [0, 1999, 3999])
def test_a_line_one_pixel_wide_survives_narrowing_in_its_place(column):
    binary = np.zeros((300, 4000), bool)
    binary[:, column] = True
    image = np.zeros(binary.shape, np.uint8)
    ((_, uri),) = embedded([MeasuredPicture("a", image, binary)])
    lit = decoded(uri) > 0
    columns = np.flatnonzero(lit.any(axis=0))
    assert lit[:, columns].all()
    assert columns.tolist() == [column // 4]


def test_many_noisy_pictures_share_three_megabytes():
    image = noise(700, 1000)
    pictures = [MeasuredPicture(str(n), np.roll(image, n)) for n in range(6)]
    uris = embedded(pictures)
    assert sum(len(grey) for grey, _ in uris) <= 3_000_000
    assert len({decoded(grey).shape for grey, _ in uris}) == 1
    assert decoded(uris[0][0]).shape[1] >= 500
