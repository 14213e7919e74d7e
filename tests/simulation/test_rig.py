"""The simulated rig and its sheets of light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.rig import field_centre, paper_rig


def test_the_first_sheet_is_the_light_plane():
    rig = paper_rig()
    second = LightPlane(np.array([0.1, 0.9, 0.4]), 450.0, "second")
    both = replace(rig, light_planes=(rig.light_plane, second))
    assert both.light_plane is rig.light_plane


@pytest.mark.parametrize("copies", [0, 2])
def test_sheets_without_a_name_of_their_own_are_refused(copies):
    rig = paper_rig()
    with pytest.raises(InputError, match="sheets of light are called"):
        replace(rig, light_planes=rig.light_planes * copies)


def test_the_field_centre_is_the_nearest_point_to_the_axis_in_the_middle_depth():
    rig = paper_rig()
    centre, plane = field_centre(rig), rig.light_plane
    along = np.array([-plane.normal[1], plane.normal[0], 0.0])
    assert plane.normal @ centre == pytest.approx(plane.distance_mm)
    assert centre[2] == pytest.approx(1100.0)
    assert centre @ along == pytest.approx(0.0, abs=1e-9)
