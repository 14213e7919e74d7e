"""A plan from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.plan import ViewCounts
from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.measurement.length_plan import PlanOptions
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig
from sheetoflight.workflow.planned import plan
from tests.planned_rigs import RIG_TOML, write_rig


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the paper's rig, simulated; not to be changed."""
    truth = paper_rig()
    seen = observed_rig(truth, 12, 6, 0.1, np.random.default_rng(0))
    path = tmp_path_factory.mktemp("calibrated") / "calibration.json"
    calibrate(Rig(truth.target, truth.camera.image_size, observations=seen)).save(path)
    return path


def test_a_stated_rig_needs_no_assumption_but_the_lens(tmp_path: Path) -> None:
    found = plan(write_rig(tmp_path), PlanOptions(length_mm=200.0))
    (assumed,) = found.assumptions
    assert "no distortion" in assumed
    assert found.nominal.camera.alpha == pytest.approx(2300.0)
    (plane,) = found.nominal.light_planes
    assert np.degrees(np.arcsin(plane.normal[2])) == pytest.approx(24.0)
    assert plane.distance_mm / plane.normal[2] == pytest.approx(1386.0)
    assert not found.after_taken


def test_what_is_not_stated_is_named(tmp_path: Path) -> None:
    for key in ("tolerance_mm", "pixel_std", "placement_std_mm", "depth_mm", "pivot_mm"):
        lines = [line for line in RIG_TOML.splitlines() if not line.startswith(key)]
        found = plan(write_rig(tmp_path, "\n".join(lines)), PlanOptions(length_mm=100.0))
        assert any(f"no {key}" in assumption for assumption in found.assumptions), key


def test_the_folder_will_do(tmp_path: Path) -> None:
    write_rig(tmp_path)
    options = PlanOptions(ViewCounts(12, 6))
    assert plan(tmp_path, options).expected == plan(tmp_path / "rig.toml", options).expected


def test_a_calibration_is_planned_on(tmp_path: Path, calibration: Path) -> None:
    """What its views are predicted to know is what it states."""
    rig = write_rig(tmp_path, RIG_TOML.partition("[plan]")[0])
    found = plan(rig, PlanOptions(ViewCounts(12, 6)), calibration)
    assert found.after_taken
    before = {position.before_mm for position in found.next_positions}
    assert len(before) == 1
    assert before.pop() == pytest.approx(found.expected.median, rel=0.5)
    assert {position.view.stage for position in found.next_positions} == {"camera", "plane"}


def test_two_lasers_have_a_sheet_each(tmp_path: Path) -> None:
    lasers = '\n[[laser]]\nname = "left"\nsheet_roll_deg = 180\n[[laser]]\nname = "right"\n'
    found = plan(write_rig(tmp_path, RIG_TOML + lasers), PlanOptions(ViewCounts(12, 6, 2)))
    left, right = found.nominal.light_planes
    assert left.normal[0] < 0 < right.normal[0]
    assert [field.laser for field in found.coarse] == ["left", "right"]
    assert found.expected.median > 0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[plan]", "[[laser]]\nname = 'a'\n[plan]\nfocal_px = 2300", "gives focal_px and focal_mm"),
        ("pixel_um = 6.45", "", "gives focal_mm – give focal_px alone, or focal_mm and pixel_um"),
        ("sheet_angle_deg = 24", "", "'sheet_angle_deg' of laser laser is missing"),
        ("working_distance_mm = 1386", "", "'working_distance_mm' of laser laser is missing"),
        ("sheet_angle_deg = 24", "sheet_angle_deg = 0", "sheet_angle_deg is 0"),
        ("sheet_angle_deg = 24", "sheet_angle = 24", "unknown key 'sheet_angle' in .plan. – did"),
        ("[900, 1300]", "[1300, 900]", "depth_mm is .1300.0, 900.0. – give the nearest"),
        ("[900, 1300]", "[9000, 13000]", "does not see the sheet of laser within depth_mm"),
        ("[0, -120, 1000]", "[0, -120, -1000]", "pivot_mm is .* – give a point in front"),
        ("[0, -120, 1000]", "[0, -120, 300]", "of the pivoting target lie wholly in the picture"),
        ("[plan]", '[[laser]]\nname = "a"\n[[laser]]\nname = "b"\n[plan]', "have the same sheet"),
    ],
)
def test_what_cannot_be_planned_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in RIG_TOML
    with pytest.raises(InputError, match=said):
        plan(write_rig(tmp_path, RIG_TOML.replace(old, new, 1)))


def test_a_rig_without_a_plan_is_refused(tmp_path: Path) -> None:
    text = RIG_TOML.partition("[plan]")[0]
    with pytest.raises(InputError, match=r"rig\.toml has no table \[plan\] – add one with focal"):
        plan(write_rig(tmp_path, text))
    stray = text + '[[laser]]\nname = "a"\nsheet_roll_deg = 3\n'
    with pytest.raises(InputError, match=r"laser a has a sheet, but there is no \[plan\]"):
        plan(write_rig(tmp_path, stray))
    with pytest.raises(FileError, match="does not exist"):
        plan(tmp_path / "none.toml")


def test_another_rigs_calibration_is_refused(tmp_path: Path, calibration: Path) -> None:
    other = RIG_TOML.replace("[1392, 1040]", "[640, 480]")
    with pytest.raises(InputError, match=r"calibration\.json: the calibration is of a 1392 × 1040"):
        plan(write_rig(tmp_path, other), calibration=calibration)


@pytest.mark.parametrize("counts", [ViewCounts(1, 1), ViewCounts(0, 1), ViewCounts(2, 0, 1)])
def test_too_few_views_are_refused(tmp_path: Path, counts: ViewCounts) -> None:
    with pytest.raises(UntrustworthyError, match="do not determine camera and sheet"):
        plan(write_rig(tmp_path), PlanOptions(counts))
