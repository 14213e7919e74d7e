"""Sheets of light that bend, found by their lines on boards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.curved_sheets import _odds_of_flat, _unbent
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.methods import CalibrationOptions, calibrate
from sheetoflight.calibration.rig_state import bend_names
from sheetoflight.calibration.screening import screened
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.light_cone import LightCone, touching_sheet
from sheetoflight.simulation.rig import SimulatedRig

FLAT = board_rig(distortion=(-0.1, 0.05, 0.0, 0.0, 0.0))
STD_PX = 0.1


def cone(half_angle_deg: float) -> SimulatedRig:
    """The rig with a sheet in the shape of a cone, its apex 700 mm beside the middle."""
    plane = FLAT.light_planes[0]
    middle = plane.intersect(np.array([[0.0, 0.0, 1.0]]))[0]
    down = np.array([0.0, 1.0, 0.0]) - plane.normal[1] * plane.normal
    apex = middle - 700.0 * down / np.linalg.norm(down)
    shape = LightCone(apex, plane.normal, np.radians(half_angle_deg))
    return replace(FLAT, light_planes=(touching_sheet(shape, middle),), cones=(shape,))


def seen(truth: SimulatedRig, seed: int, views: int = 12, std: float = STD_PX) -> Rig:
    """Boards across the sheet."""
    board = FLAT.board
    assert board is not None
    turns, shifts = board_poses(FLAT, board, views, np.random.default_rng(7))
    rng = np.random.default_rng([seed, 11])
    boards = observed_boards(truth, board, turns, shifts, rng, std, std, line_points=300)
    known = Observations(board=boards)
    size = truth.camera.image_size
    return Rig(CollinearTarget(), size, "radial2", board=board, observations=known)


def places(truth: SimulatedRig, rig: Rig) -> Array:
    """Points of the true sheet near the middle of the boards, mm."""
    uv = rig.observations.board.line.uv[::37]
    sheet, shape = truth.light_planes[0], truth.cones[0]
    assert shape is not None
    points = sheet.intersect(truth.camera.unproject(uv))
    rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(5):
        slope = np.sum(rays * shape.gradients(points), axis=1)
        points = points - rays * (shape.heights(points) / slope)[:, None]
    return points


def rms_error(found: Calibration, truth: SimulatedRig, points: Array) -> float:
    """Of lengths between points of the sheet, mm: where the camera is, they do not tell."""
    measured = found.light_plane.intersect(found.camera.unproject(truth.camera.project(points)))
    ends = np.random.default_rng(0).permutation(len(points))
    lengths = [np.linalg.norm(p - p[ends], axis=1) for p in (measured, points)]
    return float(np.sqrt(np.mean((lengths[0] - lengths[1]) ** 2)))


def flat_fit(rig: Rig) -> Fit:
    """The joint fit of planes."""
    boards = screened_boards(rig)
    fit = screened(boards.rig, boards.state).fit
    assert fit is not None
    return fit


def test_a_cone_is_found_told_and_measured_with() -> None:
    truth = cone(88.8)
    rig = seen(truth, 0)
    points = places(truth, rig)
    found = calibrate(rig)
    assert found.light_plane.curvature is not None
    assert any("is curved" in warning and "--flat" in warning for warning in found.warnings)
    as_plane = calibrate(rig, options=CalibrationOptions(flat=True))
    assert as_plane.light_plane.curvature is None
    assert rms_error(found, truth, points) < 0.25 * rms_error(as_plane, truth, points)


def bowed(rig: SimulatedRig, seed: int) -> Rig:
    """What is seen of a board that is bent by 0.2 mm, on a flat sheet."""
    board = rig.board
    assert board is not None
    turns, shifts = board_poses(rig, board, 12, np.random.default_rng(7))
    half = board.points[:, 0].max() / 2.0
    along = (board.points[:, 0] - half) / half
    bent = board.points + np.outer(0.2 * (1.0 - along**2), [0.0, 0.0, 1.0])
    views = seen(rig, seed).observations.board
    noise = views.uv - rig.camera.project(board.points @ np.swapaxes(turns, 1, 2) + shifts[:, None])
    uv = noise + rig.camera.project(bent @ np.swapaxes(turns, 1, 2) + shifts[:, None])
    lines = []
    for view, (turn, shift) in enumerate(zip(turns, shifts, strict=True)):
        pixels = views.line.uv[views.line.view == view]
        rays = rig.camera.unproject(pixels)
        own = (rays * (turn[:, 2] @ shift / (rays @ turn[:, 2]))[:, None] - shift) @ turn
        raised = own + np.outer(0.2 * (1.0 - ((own[:, 0] - half) / half) ** 2), [0.0, 0.0, 1.0])
        # along the sheet and the board's rows: where the raised board meets the light again
        points, normal = raised @ turn.T + shift, rig.light_planes[0].normal
        step = (rig.light_planes[0].distance_mm - points @ normal) / (turn[:, 0] @ normal)
        lines.append(rig.camera.project(points + np.outer(step, turn[:, 0])))
    line = replace(views.line, uv=np.concatenate(lines))
    known = Observations(board=replace(views, uv=uv, line=line))
    return replace(seen(rig, seed), observations=known)


def test_a_bent_board_does_not_bend_the_sheet() -> None:
    """Its lines are bowed as those of a curved sheet are; its points tell which it is."""
    found = calibrate(bowed(FLAT, 0))
    assert found.light_plane.curvature is None
    assert any("the board itself is bent" in warning for warning in found.warnings)


def test_a_flat_sheet_beside_a_curved_one_stays_flat() -> None:
    truth = cone(88.8)
    flat = replace(FLAT.light_planes[0], name="flat")
    both = replace(truth, light_planes=(*truth.light_planes, flat), cones=(*truth.cones, None))
    rig = replace(seen(both, 0, views=16), lasers=("laser", "flat"))
    found = calibrate(rig)
    assert [plane.curvature is not None for plane in found.light_planes] == [True, False]
    assert any("laser is curved" in warning for warning in found.warnings)
    assert "flat.kxx" not in found.covariance.parameters


def test_a_flat_sheet_stays_flat() -> None:
    found = calibrate(seen(FLAT, 0))
    assert found.light_plane.curvature is None
    assert not any("curved" in warning for warning in found.warnings)


def test_the_odds_of_a_flat_sheet_are_odds() -> None:
    """Of 40 flat rigs, they are evenly spread between 0 and 1; Kolmogorov's test fails once in a
    thousand times."""
    odds = []
    for seed in range(40):
        fit = flat_fit(seen(FLAT, 100 + seed, views=8))
        assert fit.adjustment.boards is not None
        bends = _unbent(fit.adjustment.boards, fit.state)
        odds.append(float(_odds_of_flat(fit, replace(fit.state, bends=bends))[0]))
    assert kstest(odds, "uniform").pvalue > 1e-3


def test_the_stated_uncertainty_holds() -> None:
    """χ² of the three curvatures against the cone's own at the middle, over 30 trials: 90 degrees
    of freedom, limits of 1e-4. The cone is so flat that its third order is nothing."""
    truth = cone(89.6)
    parts = tuple(f"laser.{part}" for part in ("kxx", "kxy", "kyy"))
    total = 0.0
    for seed in range(30):
        found = calibrate(seen(truth, seed))
        bend = found.light_plane.curvature
        assert bend is not None
        shape = truth.cones[0]
        assert shape is not None
        near = bend.centre
        own = touching_sheet(shape, near - shape.heights(near) * shape.gradients(near)).curvature
        assert own is not None
        turned = bend.axes.T @ own.axes
        xx, xy, yy = own.per_mm
        true = turned @ np.array([[xx, xy], [xy, yy]]) @ turned.T
        off = bend.per_mm - [true[0, 0], true[0, 1], true[1, 1]]
        total += float(off @ np.linalg.solve(found.covariance.block(parts), off))
    assert chi2.ppf(1e-4, 90) < total < chi2.isf(1e-4, 90)


def test_derivatives_by_the_bend_are_right() -> None:
    """Against differences: the lines' misses are linear in it."""
    fit = flat_fit(seen(cone(88.8), 3))
    assert fit.adjustment.boards is not None
    bends = _unbent(fit.adjustment.boards, fit.state)
    names = (*fit.adjustment.parameters, *bend_names(1))
    wide = Adjustment(fit.adjustment.positions, {}, {}, names, None, fit.adjustment.boards)
    flat = replace(fit.state, bends=bends)
    block = wide.blocks(flat)[-1]
    for k, step in enumerate((1e-6, 1e-6, 1e-6)):
        change = np.zeros((1, 3))
        change[0, k] = step
        moved = replace(flat, bends=replace(bends, per_mm=bends.per_mm + change))
        slope = (wide.blocks(moved)[-1].residuals - block.residuals) / step
        column = block.columns.tolist().index(names.index(bend_names(1)[k]))
        assert slope == pytest.approx(block.by_shared[..., column], rel=1e-6, abs=1e-3)
