"""Numbers as text: rounding, and the words that go with them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sheetoflight.model.light_plane import LightPlane
from sheetoflight.report import numbers
from tests.report.examples import (
    CAMERA_STD,
    NO_COVARIANCE,
    RIG,
    example_calibration,
    facing_calibration,
)


@given(st.floats(-1e5, 1e5), st.floats(1e-7, 50.0))
def test_value_and_uncertainty_end_at_the_uncertaintys_second_digit(value, std):
    value_text, std_text = numbers.rounded(value, std)
    assert float(std_text) == pytest.approx(std, rel=0.051)
    decimals = [len(text.partition(".")[2]) for text in (value_text, std_text)]
    assert decimals[0] == decimals[1]
    assert float(value_text) == pytest.approx(value, abs=0.51 * 10.0 ** -decimals[0])
    assert 1 <= len(std_text.replace(".", "").lstrip("0")) <= 3


def test_camera_parameters_carry_their_uncertainty_or_are_called_fixed(calibration):
    rows = numbers.camera_quantities(calibration)
    by_name = dict(zip(calibration.camera.PARAMETERS, rows, strict=True))
    for name, row in by_name.items():
        if name in CAMERA_STD:
            assert float(row.std) == pytest.approx(CAMERA_STD[name])
        else:
            assert row.std == "fixed"
    assert by_name["alpha"].value == "2298.7"
    assert by_name["k1"].value == "-0.1000"


def test_without_any_covariance_nothing_is_called_fixed():
    calibration = example_calibration(covariance=NO_COVARIANCE)
    rows = numbers.camera_quantities(calibration)
    rows += numbers.plane_quantities(calibration, calibration.light_plane)
    assert {row.std for row in rows} == {"not given"}


def test_the_tilt_of_the_sheet_moves_with_its_normal(calibration):
    """The normal turns by TILT_STD about every axis in the sheet, so its tilt does as well."""
    row = numbers.plane_quantities(calibration, calibration.light_plane)[-1]
    normal = RIG.light_plane.normal
    assert float(row.value) == pytest.approx(90 - np.degrees(np.arccos(normal[2])), abs=5e-4)
    assert float(row.std) == pytest.approx(np.degrees(3e-4), rel=0.03)


def test_points_of_the_sheet_satisfy_the_equation_in_the_papers_form():
    plane = RIG.light_plane
    text = numbers.paper_equation(plane).replace("−", "-").replace(" ", "")
    found = re.fullmatch(r"(.+)X(.+)Y(.+)Z\+1000=0", text)
    assert found
    a, b, c = (float(x) for x in found.groups())
    rays = np.random.default_rng(1).normal(size=(50, 3)) * 0.1 + [0, 0, 1]
    points = rays * (plane.distance_mm / (rays @ plane.normal))[:, None]
    left = points @ [a, b, c] + 1000
    assert (np.abs(left) <= 5e-5 * np.abs(points).sum(axis=1)).all()


def test_signs_of_the_equation_are_read_as_written():
    plane = LightPlane(np.array([0.6, -0.8, 0.0]), 1000.0)
    assert numbers.paper_equation(plane) == "−0.6000 X + 0.8000 Y − 0.0000 Z + 1000 = 0"


def test_field_of_view_and_pixel_size_of_a_camera_facing_the_sheet():
    rows = numbers.view_quantities(facing_calibration(2000.0))
    across, down = 2 * np.degrees(np.arctan(np.array([696, 520]) / 2000.0))
    assert [row.value for row in rows] == [
        f"{across:.2f}",
        f"{down:.2f}",
        "1000.0",
        "0.5000",
        "0.5000",
    ]


@pytest.mark.parametrize(
    ("chi2", "words"),
    [
        (1.0, "estimated from the residuals"),
        (1.01, "agree"),
        (0.9, "agree"),
        (3.0, "larger than the noise explains"),
        (0.2, "smaller than the stated noise"),
        (float("nan"), "not known"),
    ],
)
def test_chi_squared_is_put_into_words(chi2, words):
    assert words in numbers.noise_in_words(example_calibration(chi2_per_dof=chi2))


def test_nested_provenance_is_flattened_in_its_order():
    mapping = {"b": {"y": 1, "x": {"z": None, "w": False}}, "a": ["p", 2], "c": "text"}
    assert list(numbers.flat(mapping)) == [
        ("b.y", "1"),
        ("b.x.z", "–"),
        ("b.x.w", "no"),
        ("a", "p, 2"),
        ("c", "text"),
    ]
