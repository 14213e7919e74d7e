"""What the report says and shows of a curved sheet of light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import PLANE_PARTS, Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.sheet_curvature import curvature_about
from sheetoflight.report import space
from sheetoflight.report.board_outlines import cut_by_sheet
from sheetoflight.report.length_field import length_fields
from sheetoflight.report.numbers import bend_in_words, parameter_unit, plane_quantities
from sheetoflight.report.page import build_report
from sheetoflight.report.point_groups import point_groups
from sheetoflight.simulation.rig import field_centre
from tests.report.examples import RIG, calibration_of_two_lasers
from tests.report.test_space import named, xyz

STD = np.diag([1e-6, 2e-6, 3e-6])
PER_MM = np.array([2e-5, 0.0, 0.0])


@pytest.fixture(scope="module")
def curved(calibration: Calibration) -> Calibration:
    """Bent along x of the sheet alone, so that sagittas can be told by hand."""
    plane = calibration.light_plane
    bend = curvature_about(plane.normal, field_centre(RIG), PER_MM)
    names = tuple(f"laser.{part}" for part in (*PLANE_PARTS, "kxx", "kxy", "kyy"))
    matrix = np.zeros((7, 7))
    matrix[:4, :4] = np.diag([1e-8, 1e-8, 1e-8, 0.01])
    matrix[4:, 4:] = STD**2
    return replace(
        calibration,
        light_planes=(replace(plane, curvature=bend),),
        covariance=Covariance(names, matrix),
    )


def test_the_bend_is_the_sagitta_of_the_farthest_point(curved: Calibration):
    plane = curved.light_plane
    bend = plane.curvature
    assert bend is not None
    seen = bend.centre + np.outer([-50.0, 100.0, 30.0], bend.axes[:, 0])
    said = bend_in_words(curved, plane, seen)  # ½ · 2e-5 · 100² = 0.1; ½ · 1e-6 · 100² = 0.005
    assert "curved" in said
    assert "0.1000 ± 0.0050 mm" in said
    assert bend_in_words(curved, plane, np.empty((0, 3))).endswith("bends away from that.")
    assert bend_in_words(curved, replace(plane, curvature=None), seen) == ""


def test_the_bend_from_the_nearest_plane_is_said_too(curved: Calibration):
    """Of a parabola ½ k x² over three places 0 and ± L, the nearest plane is k L²/6 and k L²/3
    off."""
    plane = curved.light_plane
    bend = plane.curvature
    assert bend is not None
    along = np.repeat([-100.0, 0.0, 100.0], 3)[:, None] * bend.axes[:, 0]
    across = np.tile([-100.0, 0.0, 100.0], 3)[:, None] * bend.axes[:, 1]
    seen = bend.centre + along + across
    seen += bend.heights(seen)[:, None] * plane.normal
    assert bend_in_words(curved, plane, seen).endswith("from the plane nearest to it, by 0.067 mm.")


def test_the_curvatures_stand_beside_normal_and_distance(curved: Calibration):
    rows = plane_quantities(curved, curved.light_plane)
    found = {row.symbol: row for row in rows}
    assert (found["kxx"].value, found["kxx"].std, found["kxx"].unit) == (
        *("0.0000200", "0.0000010"),
        "1/mm",
    )
    flat = plane_quantities(curved, replace(curved.light_plane, curvature=None))
    assert "kxx" not in {row.symbol for row in flat}
    assert parameter_unit("laser.kxy") == "1/mm"


def test_the_page_says_that_the_sheet_is_curved(curved: Calibration, calibration: Calibration):
    page = build_report(curved)
    assert "The sheet is curved" in page
    assert "laser.kyy" in page
    assert "The sheet is curved" not in build_report(calibration)


def test_the_figure_shows_the_surface(curved: Calibration):
    trace = named(space.points_and_sheets(curved), "laser")
    nodes = xyz(trace)
    assert np.abs(curved.light_plane.heights(nodes)).max() < 1e-3
    assert np.abs(nodes @ curved.light_plane.normal - curved.light_plane.distance_mm).max() > 0.1
    triangles = np.stack([trace.i, trace.j, trace.k], axis=1).astype(int)
    assert triangles.max() == len(nodes) - 1
    first, second, third = (nodes[triangles[:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1) / 2
    flat = xyz(named(space.points_and_sheets(as_flat(curved)), "laser"))
    rectangle = np.linalg.norm(np.cross(flat[1] - flat[0], flat[3] - flat[0]))
    assert areas.sum() == pytest.approx(rectangle, rel=1e-3)
    assert areas.min() == pytest.approx(areas.max(), rel=0.01)


def as_flat(calibration: Calibration) -> Calibration:
    (plane,) = calibration.light_planes
    return replace(calibration, light_planes=(replace(plane, curvature=None),))


def test_lengths_across_the_picture_lie_in_the_curved_sheet(curved: Calibration):
    """Their uncertainty grows by that of the curvature."""
    (bent,) = length_fields(curved)
    known = replace(
        curved,
        covariance=Covariance(curved.covariance.parameters[:4], curved.covariance.matrix[:4, :4]),
    )
    (without,) = length_fields(known)
    both = np.isfinite(bent.std_mm) & np.isfinite(without.std_mm)
    assert both.any()
    assert (bent.std_mm[both] >= without.std_mm[both]).all()
    assert (bent.std_mm[both] > 1.0001 * without.std_mm[both]).any()


def test_targets_belong_to_the_curved_sheet_in_which_they_lie():
    """Markers where the second sheet has left its plane by 0.5 mm, 0.2 mm from the first: by its
    plane alone they would be the first's."""
    two = calibration_of_two_lasers()
    view = next(v for v in two.residuals.views if v.stage == "plane")
    normal, centre = RIG.light_plane.normal, field_centre(RIG)
    bend = curvature_about(normal, centre, np.array([1e-4, 0.0, 0.0]))  # ½ · 1e-4 · 100² = 0.5
    distance = float(normal @ centre)
    steps = np.linspace(-1.0, 1.0, len(view.xyz))[:, None]
    markers = centre + 100.0 * bend.axes[:, 0] + steps * bend.axes[:, 1] + 0.5 * normal
    found = replace(
        two,
        light_planes=(
            LightPlane(normal, distance + 0.3, "first"),
            LightPlane(normal, distance, "second", bend),
        ),
        residuals=replace(two.residuals, views=(replace(view, xyz=markers),)),
    )
    (group,) = point_groups(found)
    assert (group.title, group.laser) == ("plane, second", 1)


def test_an_outline_is_cut_where_it_meets_the_curved_sheet(curved: Calibration):
    plane = curved.light_plane
    start = plane.intersect(np.array([0.05, 0.1, 1.0]))
    step = plane.normals_at(start) * 5.0
    aside = np.cross(step, [0.0, 1.0, 0.0])
    corners = start + np.array([step, -step, -step + aside, step + aside, step])
    (first, _) = cut_by_sheet(corners, plane)
    assert np.linalg.norm(first - start) < 1e-3
