"""Coded markers, read back by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.imaging.marker_codes import marker_codes
from sheetoflight.model.board import PlanarBoard


@pytest.mark.parametrize("name", ["DICT_4X4_50", "DICT_6X6_250", "DICT_ARUCO_ORIGINAL"])
def test_every_code_is_read_under_its_number(name):
    """Drawn with a white margin, 12 px a cell, and upright: the first corner found is the first
    cell's."""
    codes = marker_codes(PlanarBoard("charuco", 4, 4, (20.0, 20.0), dictionary=name))
    assert len(codes) == 12
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)))
    for number, code in enumerate(codes):
        cells = np.pad(np.where(np.array(code), 0, 255).astype(np.uint8), 2, constant_values=255)
        corners, ids, _ = detector.detectMarkers(np.kron(cells, np.ones((12, 12), np.uint8)))
        assert np.ravel(ids).tolist() == [number]
        np.testing.assert_allclose(corners[0][0, 0], (23.5, 23.5), atol=1.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [("DICT_9X9", "not known"), ("imread", "not known"), ("DICT_4X4_50", "60 markers")],
)
def test_what_cannot_be_is_refused(name, message):
    with pytest.raises(InputError, match=message):
        marker_codes(PlanarBoard("charuco", 11, 9, (20.0, 20.0), dictionary=name))
