"""Curved sheets in ``calibration.json``, and in files that cannot hold them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.io.calibration_json import calibration_text, read_calibration, write_calibration
from sheetoflight.io.exchange import read_exchange, write_exchange
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import curvature_about

Change = Callable[[dict[str, Any]], object]
CENTRE = np.array([100.0 / 3.0, -20.0 / 7.0, 1000.0 + 1.0 / 9.0])
PER_MM = np.array([1e-5 / 3.0, -1e-6 / 7.0, 2e-5 / 9.0])


@pytest.fixture
def curved(calibration: Calibration) -> Calibration:
    plane = calibration.light_plane
    bend = curvature_about(plane.normal, CENTRE, PER_MM, first_axis=np.array([0.1, 0.9, 0.3]))
    names = (*calibration.covariance.parameters, "laser.kxx", "laser.kxy", "laser.kyy")
    root = np.random.default_rng(8).normal(size=(len(names), len(names)))
    return replace(
        calibration,
        light_planes=(replace(plane, curvature=bend),),
        covariance=Covariance(names, root @ root.T),
    )


def test_a_curvature_comes_back_exactly(curved: Calibration, tmp_path: Path):
    write_calibration(tmp_path / "one.json", curved)
    back = read_calibration(tmp_path / "one.json")
    was, found = curved.light_plane.curvature, back.light_plane.curvature
    assert was is not None
    assert found is not None
    for name in ("centre", "axes", "per_mm"):
        np.testing.assert_array_equal(getattr(found, name), getattr(was, name))
    assert back.covariance.parameters[-3:] == ("laser.kxx", "laser.kxy", "laser.kyy")
    np.testing.assert_array_equal(back.covariance.matrix, curved.covariance.matrix)
    write_calibration(tmp_path / "two.json", back)
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


def test_the_keys_are_there_only_for_a_curved_sheet(calibration: Calibration, curved: Calibration):
    (flat,) = json.loads(calibration_text(calibration))["light_planes"]
    (bent,) = json.loads(calibration_text(curved))["light_planes"]
    assert list(flat) == ["name", "normal", "distance_mm"]
    assert list(bent) == [*flat, "curvature"]
    assert list(bent["curvature"]) == ["centre", "axes", "per_mm"]
    assert np.shape(bent["curvature"]["axes"]) == (3, 2)
    assert bent["curvature"]["per_mm"] == PER_MM.tolist()


WRONG: dict[str, tuple[Change, str]] = {
    "no number": (lambda c: c.update(per_mm=[1e-5, "x", 0.0]), "per_mm"),
    "not finite": (lambda c: c.update(per_mm=[1e-5, math.nan, 0.0]), "per_mm|NaN|finite"),
    "two curvatures": (lambda c: c.update(per_mm=[1e-5, 0.0]), "per_mm"),
    "two rows": (lambda c: c.update(axes=c["axes"][:2]), "axes"),
    "rows of three": (lambda c: c.update(axes=np.eye(3).tolist()), "axes"),
    "skew axes": (lambda c: c["axes"][0].reverse(), r"light_planes\[0\].*(axes|curvature)"),
    "out of the plane": (
        lambda c: c.update(axes=[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
        r"light_planes\[0\].*out of the plane",
    ),
    "no centre": (lambda c: c.pop("centre"), "centre"),
}


@pytest.mark.parametrize(("change", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_curvature_is_refused_by_its_key(
    change: Change, said: str, curved: Calibration, tmp_path: Path
):
    document = json.loads(calibration_text(curved))
    change(document["light_planes"][0]["curvature"])
    path = tmp_path / "c.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=said) as refused:
        read_calibration(path)
    assert "c.json" in str(refused.value)


@pytest.mark.parametrize("to", ["opencv", "halcon", "bouguet"])
def test_files_for_planes_hold_the_plane_and_say_what_is_lost(
    to: str, calibration: Calibration, curved: Calibration, tmp_path: Path
):
    ending = {"opencv": "yml", "halcon": "cal", "bouguet": "mat"}[to]
    camera = replace(curved.camera, gamma=0.0, distortion=(0.0,) * 5)
    path = tmp_path / f"c.{ending}"
    notes = write_exchange(path, replace(curved, camera=camera), to)
    assert [note for note in notes if "the curvature of laser has no place in it" in note]
    flat = write_exchange(tmp_path / f"d.{ending}", replace(calibration, camera=camera), to)
    assert not [note for note in flat if "curvature" in note]
    (plane,) = read_exchange(path).light_planes
    assert isinstance(plane, LightPlane)
    assert plane.curvature is None
    np.testing.assert_allclose(plane.normal, curved.light_plane.normal, atol=1e-9)
    assert plane.distance_mm == pytest.approx(curved.light_plane.distance_mm)
