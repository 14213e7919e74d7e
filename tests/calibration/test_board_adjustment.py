"""Boards in the adjustment: derivatives, OpenCV's optimum, exact and noisy rigs."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.components import COMPONENTS, CORNER, LINE, SHAPE, STRIPE
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.lines_on_boards import RAY, reduced_lines
from sheetoflight.calibration.methods import calibrate
from sheetoflight.calibration.noise import NoiseModel, noise_model
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_faults import lines_beyond, shifted_lines
from sheetoflight.simulation.board_poses import BoardHolding, board_poses, board_rig
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from sheetoflight.simulation.bodies import folded_body
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.boards import rig_of, seen_boards, without_lines

STEP = 1e-6


def off(calibration: Calibration, truth: SimulatedRig) -> tuple[float, float]:
    """Angle between the sheets in degrees, and the difference of their distances in mm."""
    found, plane = calibration.light_plane, truth.light_plane
    angle = np.degrees(np.arccos(min(1.0, float(found.normal @ plane.normal))))
    return float(angle), found.distance_mm - plane.distance_mm


def misses(calibration: Calibration, truth: SimulatedRig) -> float:
    """Squared Mahalanobis distance of the sheet from the truth: chi-squared with 3 degrees of
    freedom, above 25 once in 65 000 times."""
    names = tuple(f"laser.{part}" for part in ("nx", "ny", "nz", "d"))
    found, plane = calibration.light_plane, truth.light_plane
    shift = np.append(found.normal - plane.normal, found.distance_mm - plane.distance_mm)
    covariance = calibration.covariance.block(names)
    return float(shift @ np.linalg.pinv(covariance, rcond=1e-12) @ shift)


def true_state(truth: SimulatedRig, views: int, rng: np.random.Generator) -> tuple[Rig, RigState]:
    """A rig at its truth, moved a little so that no residual is zero."""
    board = truth.board
    assert board is not None
    turns, shifts = board_poses(truth, board, views, rng)
    seen = photographed_boards(
        truth.camera, placed_boards(truth, board, turns, shifts, 60), rng, 0.2, 0.2
    )
    normals = [plane.normal for plane in truth.light_planes]
    state = RigState(
        truth.camera,
        np.zeros(3),
        np.array([np.stack([*tangent_basis(n), n], axis=1) for n in normals]),
        np.array([plane.distance_mm for plane in truth.light_planes]),
        {"board": np.concatenate([turns, shifts[..., None]], axis=2)},
    )
    return replace(rig_of(truth, seen, "brown"), skew=True), state


@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("sizes", [(0.0, 0.0), (0.3, 0.0), (0.3, 0.1)], ids=str)
def test_derivatives_are_those_of_the_residuals(solid: bool, sizes: tuple[float, float]) -> None:
    rng = np.random.default_rng(4)
    truth = board_rig(folded_body() if solid else None, (-0.1, 0.05, 0.001, -0.001, 0.02))
    rig, state = true_state(truth, 3, rng)
    variances = noise_model(rig).variances.copy()
    variances[[LINE, SHAPE]] = sizes
    noise = NoiseModel({}, variances, np.zeros(len(COMPONENTS), dtype=bool))
    free = EstimationTask.of_everything(rig, noise).free
    adjustment = noise.adjustment(rig, {}, free, state)
    (block,) = adjustment.blocks(state)
    still = np.zeros((3, 6))
    scale = {"alpha": 1e3, "beta": 1e3, "gamma": 1e3, "u0": 1e3, "v0": 1e3, "d": 1e3}
    for place, name in enumerate(free):
        step = np.zeros(len(free))
        step[place] = STEP * scale.get(name.split(".")[1], 1.0)
        ends = [adjustment.blocks(adjustment.moved(state, s, [still]))[0] for s in (step, -step)]
        slope = (ends[0].residuals - ends[1].residuals) / (2.0 * step[place])
        own = block.by_shared[..., block.columns.tolist().index(place)]
        assert np.allclose(slope, own, rtol=0, atol=3e-5 * np.abs(own).max()), name
    none = np.zeros(len(free))
    for k in range(6):
        step = still.copy()
        step[:, k] = STEP if k < 3 else 1e3 * STEP
        ends = [adjustment.blocks(adjustment.moved(state, none, [s]))[0] for s in (step, -step)]
        slope = (ends[0].residuals - ends[1].residuals) / (2.0 * step[0, k])
        own = block.by_local[..., k]
        assert np.allclose(slope, own, rtol=0, atol=3e-5 * np.abs(own).max()), k


def test_reduced_lines_say_what_all_their_points_say() -> None:
    """``RᵀR = ZᵀZ`` with the rows of all points worked out one by one."""
    truth, views = seen_boards(np.random.default_rng(1), 3, 0.1, 0.1)
    camera, line = truth.camera, views.line
    reduced = reduced_lines(line, camera)
    rays = camera.unproject(line.uv)
    for number, own in enumerate(line.groups()):
        ell = reduced.lines[number]
        foot = rays[own].copy()
        foot[:, :2] -= (rays[own] @ ell)[:, None] * ell[:2]
        _, by_point, by_camera = camera.project_with_jacobians(foot)
        slope = np.array([np.linalg.solve(b[:, :2].T, ell[:2]) for b in by_point])
        steep = np.linalg.norm(slope, axis=1)
        rows = np.concatenate([rays[own], -np.einsum("pi,pik->pk", slope, by_camera)], axis=1)
        rows /= steep[:, None]
        products = rows.T @ rows
        root = reduced.roots[number][:, : RAY + 10]
        size = np.sqrt(np.diag(products))
        size[size == 0] = 1.0
        assert np.abs((root.T @ root - products) / size[:, None] / size).max() < 1e-8


def test_boards_alone_give_opencv_s_optimum() -> None:
    truth, views = seen_boards(
        np.random.default_rng(2), 10, 0.3, distortion=(-0.1, 0.05, 0, 0, 0.0)
    )
    rounded = views.uv.astype(np.float32)  # OpenCV's own
    rig = rig_of(truth, without_lines(replace(views, uv=rounded, std=None)), "brown")
    found = calibrate(rig)
    assert truth.board is not None
    points = [truth.board.points.astype(np.float32)] * len(views)
    pixels = [uv[:, None] for uv in rounded]
    rms, matrix, lens, _, _ = cv2.calibrateCamera(
        points, pixels, truth.camera.image_size, None, None, criteria=(3, 200, 1e-15)
    )
    assert found.residuals.rms_px * np.sqrt(2.0) == pytest.approx(rms, rel=1e-6)
    assert np.allclose(found.camera.matrix, matrix, rtol=1e-6)
    assert np.allclose(found.camera.distortion, lens.ravel(), rtol=1e-4, atol=1e-6)
    assert found.light_planes == ()


def test_exact_pictures_give_the_exact_rig() -> None:
    truth, views = seen_boards(np.random.default_rng(3), 8)
    found = calibrate(rig_of(truth, views))
    assert np.allclose(found.camera.parameters, truth.camera.parameters, rtol=1e-6, atol=1e-6)
    angle, distance = off(found, truth)
    assert angle < 1e-5
    assert abs(distance) < 1e-4


def test_order_of_views_does_not_matter() -> None:
    truth, views = seen_boards(np.random.default_rng(5), 8, 0.1, 0.1)
    one = calibrate(rig_of(truth, views))
    other = calibrate(rig_of(truth, views.take(np.arange(8)[::-1])))
    assert np.allclose(one.camera.parameters, other.camera.parameters, rtol=1e-6, atol=1e-6)
    assert np.allclose(one.light_plane.normal, other.light_plane.normal, atol=1e-7)


def test_errors_are_as_large_as_they_are_said_to_be() -> None:
    """Mahalanobis distances of 30 sheets from the truth: chi-squared with 3 degrees of freedom
    each, so that their sum leaves these bounds once in 500 times."""
    squares = []
    for seed in range(30):
        truth, views = seen_boards(np.random.default_rng(seed), 8, 0.2, 0.2, line_points=100)
        squares.append(misses(calibrate(rig_of(truth, views)), truth))
    assert 54.0 < sum(squares) < 137.0


def test_noise_is_told_by_kind() -> None:
    truth, views = seen_boards(np.random.default_rng(7), 15, 0.3, 0.1)
    found = calibrate(rig_of(truth, views)).covariance.components
    told = dict(zip(found.names, found.std, strict=True))
    assert told["corner"] == pytest.approx(0.3, rel=0.06)  # 2500 coordinates: 1.4 %
    assert told["stripe"] == pytest.approx(0.1, rel=0.06)  # 3000 points: 1.3 %
    assert "line" not in told


def test_lines_that_lie_off_the_sheet_are_told_and_weigh_less() -> None:
    rng = np.random.default_rng(8)
    truth = board_rig(None, (-0.1, 0.05, 0.0, 0.0, 0.0))
    board = truth.board
    assert board is not None
    poses = board_poses(truth, board, 20, rng)
    placed = shifted_lines(board, placed_boards(truth, board, *poses), rng.normal(0, 0.5, 20))
    views = photographed_boards(truth.camera, placed, rng, 0.1, 0.1)
    found = calibrate(rig_of(truth, views))
    told = dict(
        zip(found.covariance.components.names, found.covariance.components.std, strict=True)
    )
    assert 0.15 < told["line"] < 1.0
    plain = calibrate(rig_of(truth, seen_boards(np.random.default_rng(8), 20, 0.1, 0.1)[1]))
    assert found.covariance.std("laser.d") > 1.5 * plain.covariance.std("laser.d")
    assert misses(found, truth) < 25.0


def test_windings_of_all_lines_are_not_blamed_on_the_lens() -> None:
    """A sheet that is bowed alike in all pictures moves no lens parameter beyond its noise."""
    truth, views = seen_boards(np.random.default_rng(9), 12, 0.1, 0.1)
    uv = views.line.uv.copy()
    for own in views.line.groups():
        way = np.linspace(-1.0, 1.0, len(own))
        along = uv[own[-1]] - uv[own[0]]
        across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        uv[own] += 1.5 * (way**2 - 1.0 / 3.0)[:, None] * across
    bowed = replace(views, line=replace(views.line, uv=uv))
    plain, found = (calibrate(rig_of(truth, v)) for v in (views, bowed))
    for part in ("alpha", "k1", "k2"):
        name = f"camera.{part}"
        index = truth.camera.PARAMETERS.index(part)
        shift = found.camera.parameters[index] - plain.camera.parameters[index]
        assert abs(shift) < 2.0 * plain.covariance.std(name)


def test_what_lies_beside_the_board_is_left_out() -> None:
    rng = np.random.default_rng(10)
    truth = board_rig(None, (-0.1, 0.05, 0.0, 0.0, 0.0))
    board = truth.board
    assert isinstance(board, PlanarBoard)
    poses = board_poses(truth, board, 12, rng)
    placed = lines_beyond(truth, board, placed_boards(truth, board, *poses, 400))
    views = photographed_boards(truth.camera, placed, rng, 0.1, 0.1)
    assert misses(calibrate(rig_of(truth, views)), truth) < 25.0


@pytest.mark.parametrize(
    ("on_board", "gap_mm", "beyond"), [(40, 20.0, 800), (20, 80.0, 800), (30, 200.0, 1500)]
)
def test_the_line_on_a_small_board_is_not_outvoted(
    on_board: int, gap_mm: float, beyond: int
) -> None:
    """Twenty times as many points lie on what is behind it. Lines along the pattern may be left
    out; of what lies behind, hardly a point is kept."""
    rng = np.random.default_rng(10)
    board = PlanarBoard("chessboard", 7, 5, (10.0, 10.0))
    truth = board_rig(board, (-0.1, 0.05, 0.0, 0.0, 0.0))
    poses = board_poses(truth, board, 12, rng)
    placed = placed_boards(truth, board, *poses, on_board)
    views = photographed_boards(
        truth.camera, lines_beyond(truth, board, placed, gap_mm, beyond), rng, 0.1, 0.1
    )
    rig = rig_of(truth, views)
    kept = np.bincount(screened_boards(rig).rig.observations.board.line.view, minlength=12)
    assert (kept > 0.8 * on_board).sum() >= 10
    assert (kept <= on_board).all()
    assert misses(calibrate(rig), truth) < 25.0


def test_boards_amid_the_picture_leave_its_corners_open_and_nothing_else() -> None:
    """Chi-squared of five parameters is above 30 once in 65 000 times."""
    rng = np.random.default_rng(10)
    board = PlanarBoard("chessboard", 9, 7, (10.0, 10.0))
    truth = board_rig(board, (-0.1, 0.05, 0.0, 0.0, 0.0))
    turns, shifts = board_poses(truth, board, 14, rng)
    middles = shifts + turns @ board.points.mean(axis=0)
    amid = shifts + (0.3 * middles - middles) * (1.0, 1.0, 0.0)
    placed = placed_boards(truth, board, turns, amid, 200)
    views = photographed_boards(truth.camera, placed, rng, 0.1, 0.1)
    found = calibrate(rig_of(truth, views, "brown"))
    told = [warning for warning in found.warnings if "known to" in warning]
    assert len(told) == 1
    assert "in the corners of the picture, where no board was, the distortion k3" in told[0]
    assert misses(found, truth) < 25.0
    names = [f"camera.{part}" for part in ("alpha", "beta", "u0", "v0", "k1")]
    shift = (found.camera.parameters - truth.camera.parameters)[[0, 1, 3, 4, 5]]
    assert shift @ np.linalg.solve(found.covariance.block(tuple(names)), shift) < 30.0


def test_a_wrong_view_and_wrong_points_are_named() -> None:
    truth, views = seen_boards(np.random.default_rng(11), 12, 0.1, 0.1)
    uv = views.uv.copy()
    uv[4] += np.random.default_rng(0).normal(0, 8.0, uv[4].shape)
    uv[7, 13] += [6.0, -4.0]
    found = calibrate(rig_of(truth, replace(views, uv=uv)))
    said = "\n".join(found.warnings)
    assert f"view {views.names[4]} of stage board" in said
    assert f"point 13 of view {views.names[7]}" in said
    assert misses(found, truth) < 25.0


def test_components_have_places_of_their_own() -> None:
    assert [COMPONENTS[k] for k in (CORNER, STRIPE, LINE, SHAPE)] == [
        "corner",
        "stripe",
        "line",
        "shape",
    ]


def test_edges_of_the_pattern_are_no_light() -> None:
    """A row of the pattern lies in one plane in all views of boards that are turned about it and
    about the upright; without the laser, pictures show no better lines."""
    rng = np.random.default_rng(12)
    truth = board_rig()
    board, count = truth.board, 10
    assert isinstance(board, PlanarBoard)
    tilts, turns = rng.uniform(-0.6, 0.6, (2, count, 1)) * np.eye(3)[[0, 1]][:, None]
    rotations = rotation(turns) @ rotation(tilts)
    row = board.points.reshape(board.rows, board.columns, 3)[3]
    middle = np.column_stack([rng.uniform(-50, 50, count), [60.0] * count, [1000.0] * count])
    shifts = middle - rotations @ row.mean(axis=0)
    uv = truth.camera.project(board.points @ np.swapaxes(rotations, 1, 2) + shifts[:, None])
    uv += rng.normal(scale=0.1, size=uv.shape)
    ends = uv.reshape(count, board.rows, board.columns, 2)[:, 3]
    share = np.linspace(0.0, 1.0, 60)[:, None]
    edges = np.concatenate([one[0] + share * (one[-1] - one[0]) for one in ends])
    edges += rng.normal(scale=0.2, size=edges.shape)
    own, zero = np.repeat(np.arange(count), len(share)), np.zeros(len(edges), dtype=int)
    line = LinePixels(edges, np.full(len(edges), 0.2), own, zero, zero)
    names = tuple(f"board{number}" for number in range(count))
    found = calibrate(rig_of(truth, BoardViews(names, uv, None, line)))
    assert found.light_planes == ()
    assert any("laser was off" in warning for warning in found.warnings)


def test_valleys_are_judged_by_costs_in_the_same_terms() -> None:
    """20 views of 88 corners and their lines determine k3 to 0.7, but the corners alone begin 4 px
    away from where all end: costs of lines that were reduced there and here differ by 24, as much
    as the valley test asks for."""
    truth = board_rig(distortion=(-0.1, 0.05, 0.0008, -0.0005, 0.01))
    assert truth.board is not None
    rng = np.random.default_rng([5, 33])
    poses = board_poses(truth, truth.board, 20, rng, BoardHolding(max_tilt_deg=30.0))
    rng.normal(size=20)
    views = photographed_boards(
        truth.camera, placed_boards(truth, truth.board, *poses, 1000), rng, 0.1, 0.1
    )
    found = calibrate(rig_of(truth, views, "brown"))
    off = found.camera.parameters[9] - truth.camera.parameters[9]
    assert abs(off) < 4.0 * found.covariance.std("camera.k3")
