"""``sol`` with a calibration whose sheet of light is curved."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sheetoflight.model.sheet_curvature import curvature_about
from tests.cli.laser_pictures import (
    SHEET,
    Words,
    calibration,
    expect_error,
    good,
    sol,
)

__all__ = ["good", "sol"]


@pytest.fixture
def known(tmp_path: Path) -> Path:
    centre = SHEET.intersect(calibration().camera.unproject(np.array([40.0, 40.0])))
    bend = curvature_about(SHEET.normal, centre, np.array([5e-4, 0.0, 1e-3]))
    flat = calibration()
    plane = replace(flat.light_planes[0], curvature=bend)
    replace(flat, light_planes=(plane,)).save(tmp_path / "c.json")
    return tmp_path / "c.json"


def test_points_lie_in_the_curved_sheet(known: Path, good: Path, sol: Words) -> None:
    cloud = good.parent / "cloud.npy"
    status, told, error = sol("reconstruct", known, good, "-o", cloud)
    assert (status, error) == (0, "")
    assert "the sheet of light is curved" in told
    assert "straightness" in told
    bend = json.loads(known.read_text())["light_planes"][0]["curvature"]
    found = np.load(cloud)
    points = np.stack([found[axis] for axis in "xyz"], axis=1).astype(float)
    x, y = ((points - bend["centre"]) @ np.array(bend["axes"])).T
    kxx, kxy, kyy = bend["per_mm"]
    above = points @ SHEET.normal - SHEET.distance_mm
    expected = 0.5 * (kxx * x * x + 2 * kxy * x * y + kyy * y * y)
    np.testing.assert_allclose(above, expected, atol=1e-6)
    assert np.abs(above).max() > 0.1


def test_straight_lines_of_a_curved_sheet_are_refused(known: Path, good: Path, sol: Words) -> None:
    lines = good.parent / "lines.csv"
    result = sol("reconstruct", known, good, "-o", good.parent / "cloud.csv", "--lines-csv", lines)
    expect_error(result, 2, "the sheet of light is curved", "--lines-csv")
    assert not lines.exists()
    assert not (good.parent / "cloud.csv").exists()


def test_lengths_are_measured_in_the_curved_sheet(known: Path, sol: Words, tmp_path: Path) -> None:
    segments = tmp_path / "s.csv"
    segments.write_text("segment,u1,v1,u2,v2\none,20,20,180,140\n")
    status, told, error = sol("measure", known, segments, "--json")
    assert (status, error) == (0, "")
    document = json.loads(known.read_text())
    (plane,) = document["light_planes"]
    camera = calibration().camera
    ends = []
    for uv in ([20.0, 20.0], [180.0, 140.0]):
        ray = camera.unproject(np.array(uv))
        low, high = 0.0, 5_000.0
        for _ in range(100):  # where the ray has just crossed the sheet
            depth = 0.5 * (low + high)
            place = (depth * ray - plane["curvature"]["centre"]) @ plane["curvature"]["axes"]
            kxx, kxy, kyy = plane["curvature"]["per_mm"]
            sheet = 0.5 * (place @ [[kxx, kxy], [kxy, kyy]] @ place) + plane["distance_mm"]
            low, high = (depth, high) if depth * ray @ plane["normal"] < sheet else (low, depth)
        ends.append(low * ray)
    (found,) = json.loads(told)["lengths"]
    assert found["length_mm"] == pytest.approx(np.linalg.norm(ends[1] - ends[0]), abs=1e-6)


def test_what_another_format_cannot_hold_is_said(known: Path, sol: Words, tmp_path: Path) -> None:
    status, _, error = sol("convert", known, tmp_path / "c.yml", "--to", "opencv")
    assert status == 0
    assert "the curvature of laser has no place in it" in error
