"""What the tests of the report share."""

from __future__ import annotations

import pytest

from sheetoflight.model.calibration import Calibration
from sheetoflight.report.contents import MeasuredPicture
from tests.report.examples import example_calibration, measured_picture


@pytest.fixture(scope="session")
def calibration() -> Calibration:
    return example_calibration()


@pytest.fixture(scope="session")
def picture() -> MeasuredPicture:
    return measured_picture()
